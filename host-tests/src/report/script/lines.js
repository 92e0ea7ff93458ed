function linePanel(parent, spec) {
  const p = makeFigure(parent, spec.name, spec.unit);
  p.height = spec.height || 190;
  p.values = spec.lines.filter((l) => some(l.values)).map((l) => ({ ...l, out: addKey(p.caption, l.name, l.css, l.dash ? "dash" : "") }));
  if (spec.note) {
    const note = document.createElement("span");
    note.className = "key";
    note.textContent = spec.note;
    p.caption.append(note);
  }
  const clipped = document.createElement("span");
  clipped.className = "key";
  p.caption.append(clipped);
  p.draw = () => {
    const g = prepare(p), b = p.box;
    const log = spec.log && logScale;
    const main = p.values.filter((l) => !l.limit).map((l) => l.values);
    let [lo, hi, least] = extent(main.length ? main : p.values.map((l) => l.values));
    const limits = extent(p.values.filter((l) => l.limit).map((l) => l.values));
    if (!(hi > -Infinity)) { lo = least = 0; hi = 1; }
    let above = "";
    if (log) {
      // A limit is shown where it is no more than two decades above what is measured.
      if (limits[1] > 0 && limits[1] <= Math.max(hi, 1) * 300) hi = Math.max(hi, limits[1]);
      else if (limits[1] > 0) above = "limit " + number(limits[1]) + " above the picture";
      hi = Math.max(hi, 1e-9);
      lo = Number.isFinite(lo) ? lo : hi / 10;
      // Three and a half decades; what is smaller lies on the lower edge.
      lo = Math.max(lo, hi / 3e3);
      lo = Math.pow(10, Math.floor(Math.log10(lo) * 2) / 2);
      hi = Math.pow(10, Math.ceil(Math.log10(hi * 1.1) * 4) / 4);
    } else if (spec.signed) {
      const room = Math.max((hi - least) * 0.06, 0.05);
      lo = least - room;
      hi += room;
    } else {
      lo = 0;
      if (limits[1] > 0 && limits[1] <= hi * 3) hi = Math.max(hi, limits[1]);
      else if (limits[1] > 0) above = "limit " + number(limits[1]) + " above the picture";
      hi = hi > 0 ? hi * 1.06 : 1;
    }
    clipped.textContent = above;
    const yOf = log
      ? (v) => b.y + b.h - Math.log(Math.max(v, lo) / lo) / Math.log(hi / lo) * b.h
      : (v) => b.y + b.h - (v - lo) / (hi - lo) * b.h;
    // Grid and labels of the value axis.
    g.font = font(11);
    g.textAlign = "right";
    g.textBaseline = "middle";
    let ticks;
    if (log) {
      ticks = [];
      const decades = Math.log10(hi / lo);
      const marks = decades > 3.2 ? [1] : decades > 1.6 ? [1, 3] : [1, 2, 5];
      for (let e = Math.floor(Math.log10(lo)) - 1; e <= Math.log10(hi) + 1; e++) for (const m of marks) ticks.push(m * Math.pow(10, e));
    } else {
      ticks = niceSteps(lo, hi, Math.max(4, Math.floor(b.h / 32)));
    }
    timeAxis(g, p);
    let lastY = Infinity;
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const v of ticks) {
      if (v < lo * (log ? 0.999 : 1) || v > hi) continue;
      const y = Math.round(yOf(v)) + 0.5;
      g.strokeStyle = colour.grid;
      g.lineWidth = 1;
      g.beginPath(); g.moveTo(b.x, y); g.lineTo(b.x + b.w, y); g.stroke();
      if (Math.abs(lastY - y) < 12) continue;
      lastY = y;
      g.fillStyle = colour.soft;
      const text = spec.signed ? signed(Number(v.toFixed(2)), Number.isInteger(v) ? 0 : undefined) : v >= 1000 ? v.toLocaleString("en").replace(/,/g, "\u2009") : String(Number(v.toPrecision(3)));
      g.fillText(text, b.x - 7, Math.min(Math.max(y, b.y + 5), b.y + b.h - 4));
    }
    for (const l of p.values) drawLine(g, p, l.values, yOf, { colour: colour[l.css], dash: l.dash, width: l.width, steps: l.steps });
    frame(g, p);
    overlay(g, p);
  };
  p.read = (i) => {
    for (const l of p.values) l.out.textContent = i === null ? "" : (spec.whole && l.values[i] === l.values[i] ? String(l.values[i]) : number(l.values[i])) + (spec.unit === "1" || spec.unit === "" || l.values[i] !== l.values[i] ? "" : "\u2009" + spec.unit);
  };
  panels.push(p);
}

// Rows of bars: each row is a name and ranges of epochs with a colour.
function stripPanel(parent, spec) {
  const p = makeFigure(parent, spec.name, "");
  const rowHeight = spec.rowHeight;
  p.height = spec.rows.length * rowHeight + TOP + BOTTOM;
  for (const key of spec.keys || []) addKey(p.caption, key[0], key[1], "block");
  for (const text of spec.legend || []) {
    const key = document.createElement("span");
    key.className = "key";
    key.textContent = text;
    p.caption.append(key);
  }
  const readout = document.createElement("span");
  readout.className = "key";
  const value = document.createElement("b");
  readout.append(value);
  p.caption.append(readout);
  p.draw = () => {
    const g = prepare(p), b = p.box;
    timeAxis(g, p);
    g.font = font(Math.min(11, rowHeight - 2));
    g.textBaseline = "middle";
    g.textAlign = "right";
    spec.rows.forEach((row, k) => {
      const y = b.y + k * rowHeight;
      if (row.rule && k > 0) {
        g.strokeStyle = colour.line;
        g.beginPath(); g.moveTo(b.x, y + 0.5); g.lineTo(b.x + b.w, y + 0.5); g.stroke();
      }
      g.fillStyle = colour.soft;
      g.fillText(row.label, b.x - 7, y + rowHeight / 2 + 0.5, LEFT - 9);
      g.save();
      g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip();
      for (const layer of row.layers) {
        g.fillStyle = colour[layer.css];
        const inset = layer.inset === undefined ? rowHeight * 0.3 : layer.inset;
        for (const [from, to] of layer.ranges) {
          if (T[to - 1] < view[0] || T[from] > view[1]) continue;
          const x0 = xOf(p, T[from]), x1 = xOf(p, T[to - 1] + step);
          // Never thinner than a pixel: a single epoch stays visible in a day.
          g.fillRect(x0, y + inset, Math.max(1, x1 - x0), rowHeight - 2 * inset);
        }
      }
      g.restore();
    });
    frame(g, p);
    overlay(g, p);
  };
  p.read = (i) => { value.textContent = i === null ? "" : spec.read(i); };
  panels.push(p);
}

function rangesWhere(test) {
  const out = [];
  for (let i = 0; i < N; i++) if (test(i)) {
    const last = out[out.length - 1];
    if (last && last[1] === i && (i === 0 || T[i] - T[i - 1] <= 1.6 * step)) last[1] = i + 1; else out.push([i, i + 1]);
  }
  return out;
}
// A range of satellites broken where epochs are missing.
function unbroken(ranges) {
  const out = [];
  for (const [from, to] of ranges) {
    let start = from;
    for (let i = from + 1; i < to; i++) if (T[i] - T[i - 1] > 1.6 * step) { out.push([start, i]); start = i; }
    out.push([start, to]);
  }
  return out;
}

