// Every filter of the bank: statistic over threshold.
const bank = D.bank && (() => {
  const u16 = (text) => new Uint16Array(bytes(text));
  const B = D.bank.bins, each = D.bank.each;
  // Time of the first epoch of each bin; a gap breaks a line.
  const time = Float64Array.from({ length: B }, (_, k) => T[k * each]);
  const out = new Set(D.sats.filter((s) => s.out.length).map((s) => s.id));
  const sats = D.bank.sats.map((s) => {
    const packed = [u16(s.h), u16(s.v)];
    const ratio = packed.map(() => new Float32Array(B).fill(NaN));
    let at = 0;
    for (const [from, to] of s.in) for (let k = from; k < to; k++, at++) {
      for (const a of [0, 1]) if (packed[a][at] !== 65535) ratio[a][k] = packed[a][at] / 1000;
    }
    // A single letter is a constellation.
    const id = { G: "GPS", E: "Galileo", C: "BDS" }[s.id] || s.id;
    return { id, ratio, excluded: out.has(s.id) };
  });
  const largest = [0, 1].map((a) => {
    const line = new Float32Array(B).fill(NaN);
    for (const s of sats) for (let k = 0; k < B; k++) {
      const v = s.ratio[a][k];
      if (v === v && !(v <= line[k])) line[k] = v;
    }
    return line;
  });
  return { B, each, time, sats, largest };
})();
function binOf(i) { return Math.min(bank.B - 1, Math.floor(i / bank.each)); }

function ratioPanel(parent, name, axis) {
  const p = makeFigure(parent, name, "1");
  p.height = 220;
  addKey(p.caption, "threshold", "limit", "dash");
  const outLargest = addKey(p.caption, "largest", "ink", "");
  addKey(p.caption, "each filter", "faint", "");
  if (bank.sats.some((s) => s.excluded)) addKey(p.caption, "of a satellite excluded at some time", "alert", "");
  const outPointed = addKey(p.caption, "pointed at", "level", "");
  let pointed = null, still = null, stillKey = "";

  // Largest value of each half pixel, as pieces of a line.
  function trace(g, values, yOf) {
    let x0 = NaN, best = NaN, open = false, before = NaN;
    const gap = 1.6 * step * bank.each;
    const flush = () => { if (best === best) { const y = yOf(best); if (open) g.lineTo(x0, y); else { g.moveTo(x0 - 0.5, y); g.lineTo(x0 + 0.5, y); } open = true; } };
    for (let k = 0; k < bank.B; k++) {
      const t = bank.time[k];
      if (t < view[0] - gap || t > view[1] + gap) continue;
      const v = values[k];
      if (!(v === v) || t - before > gap) { flush(); best = NaN; open = false; if (!(v === v)) { before = t; continue; } }
      before = t;
      const x = Math.round(xOf(p, t) * 2) / 2;
      if (x !== x0) { flush(); x0 = x; best = v; } else if (!(best >= v)) best = v;
    }
    flush();
  }
  function scale() {
    let hi = 1;
    const a = Math.max(0, Math.floor((lower(view[0]) - 1) / bank.each)), b = binOf(Math.min(N - 1, lower(view[1]) + 1));
    for (let k = a; k <= b; k++) if (bank.largest[axis][k] > hi) hi = bank.largest[axis][k];
    return logScale ? [0.01, Math.pow(10, Math.ceil(Math.log10(hi * 1.15) * 4) / 4)] : [0, Math.min(hi, 60) * 1.1];
  }
  function yFrom(lo, hi, b) {
    return logScale
      ? (v) => b.y + b.h - Math.log(Math.max(v, lo) / lo) / Math.log(hi / lo) * b.h
      : (v) => b.y + b.h - Math.min(v, hi) / hi * b.h;
  }
  function clipTo(g, b) { g.save(); g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip(); }
  function line(g, s, yOf, css, width) {
    g.strokeStyle = colour[css];
    g.lineWidth = width;
    g.beginPath(); trace(g, s, yOf); g.stroke();
  }

  p.draw = () => {
    const g = prepare(p), b = p.box;
    const [lo, hi] = scale();
    const yOf = yFrom(lo, hi, b);
    p.yOf = yOf;
    // The lines are many and change with the view only: they are kept as a picture.
    const key = [view, p.canvas.width, p.canvas.height, logScale, colour.paper, colour.ink, lo, hi].join();
    if (key !== stillKey) {
      stillKey = key;
      still = document.createElement("canvas");
      still.width = p.canvas.width; still.height = p.canvas.height;
      const s = still.getContext("2d");
      s.setTransform(g.getTransform());
      s.fillStyle = colour.limit;
      s.globalAlpha = 0.05;
      s.fillRect(b.x, b.y, b.w, Math.max(0, yOf(1) - b.y));
      s.globalAlpha = 1;
      timeAxis(s, p);
      s.font = font(11);
      s.textAlign = "right";
      s.textBaseline = "middle";
      const ticks = logScale ? [0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30] : niceSteps(lo, hi, 5);
      for (const v of ticks) {
        if (v < lo || v > hi) continue;
        const y = Math.round(yOf(v)) + 0.5;
        s.strokeStyle = colour.grid;
        s.lineWidth = 1;
        s.beginPath(); s.moveTo(b.x, y); s.lineTo(b.x + b.w, y); s.stroke();
        s.fillStyle = v === 1 ? colour.limit : colour.soft;
        s.fillText(String(Number(v.toPrecision(3))), b.x - 7, Math.min(Math.max(y, b.y + 5), b.y + b.h - 4));
      }
      clipTo(s, b);
      s.globalAlpha = bank.sats.length > 12 ? 0.55 : 0.8;
      s.lineJoin = "round";
      for (const sat of bank.sats) if (!sat.excluded) line(s, sat.ratio[axis], yOf, "faint", 0.75);
      s.globalAlpha = 1;
      line(s, bank.largest[axis], yOf, "ink", 1);
      const labels = [];
      for (const sat of bank.sats) if (sat.excluded) {
        // Strong where it is on its way.
        s.globalAlpha = 0.5;
        line(s, sat.ratio[axis], yOf, "alert", 0.75);
        s.globalAlpha = 1;
        line(s, sat.ratio[axis].map((v) => (v > 0.5 ? v : NaN)), yOf, "alert", 1.75);
        // Named where it is largest.
        let at = -1;
        sat.ratio[axis].forEach((v, k) => { if (v === v && bank.time[k] >= view[0] && bank.time[k] <= view[1] && (at < 0 || v > sat.ratio[axis][at])) at = k; });
        if (at >= 0 && sat.ratio[axis][at] > 0.5) labels.push([sat.id, xOf(p, bank.time[at]), yOf(sat.ratio[axis][at])]);
      }
      s.strokeStyle = colour.limit;
      s.lineWidth = 1.25;
      s.setLineDash([6, 4]);
      s.beginPath(); s.moveTo(b.x, yOf(1)); s.lineTo(b.x + b.w, yOf(1)); s.stroke();
      s.setLineDash([]);
      s.font = "600 " + font(11);
      s.textBaseline = "middle";
      const placed = [];
      for (const [text, x, y] of labels) {
        const right = x < b.x + b.w - 40;
        let yy = Math.max(y, b.y + 8);
        while (placed.some(([px, py]) => Math.abs(px - x) < 34 && Math.abs(py - yy) < 12)) yy += 12;
        placed.push([x, yy]);
        s.fillStyle = colour.alert;
        s.fillRect(x - 2, y - 2, 4, 4);
        s.textAlign = right ? "left" : "right";
        s.lineWidth = 3;
        s.strokeStyle = colour.paper;
        s.strokeText(text, right ? x + 5 : x - 5, yy);
        s.fillText(text, right ? x + 5 : x - 5, yy);
      }
      s.restore();
      frame(s, p);
    }
    g.save();
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.drawImage(still, 0, 0);
    g.restore();
    if (pointed) {
      clipTo(g, b);
      line(g, pointed.ratio[axis], yOf, "level", 2);
      const v = cursor === null ? NaN : pointed.ratio[axis][binOf(cursor)];
      if (v === v) {
        const x = xOf(p, T[cursor]), right = x < b.x + b.w - 50;
        g.font = "600 " + font(12);
        g.textAlign = right ? "left" : "right";
        g.textBaseline = "bottom";
        g.lineWidth = 4;
        g.strokeStyle = colour.paper;
        g.strokeText(pointed.id, right ? x + 6 : x - 6, yOf(v) - 4);
        g.fillStyle = colour.level;
        g.fillText(pointed.id, right ? x + 6 : x - 6, yOf(v) - 4);
      }
      g.restore();
    }
    overlay(g, p);
  };
  p.read = (i) => {
    if (i === null) { outLargest.textContent = outPointed.textContent = ""; return; }
    const k = binOf(i);
    const top = bank.sats.find((s) => s.ratio[axis][k] === bank.largest[axis][k]);
    outLargest.textContent = top ? top.id + "\u2002" + ratio(bank.largest[axis][k]) : "–";
    outPointed.textContent = pointed ? pointed.id + "\u2002" + ratio(pointed.ratio[axis][k]) : "";
  };
  const ratio = (v) => (v >= 65 ? "65 or more" : number(v));
  // The line nearest to the pointer, if one is near.
  p.point = (i, y) => {
    const before = pointed;
    pointed = null;
    if (i !== null && p.yOf) {
      const k = binOf(i);
      let near = 14;
      for (const s of bank.sats) {
        const v = s.ratio[axis][k];
        const away = v === v ? Math.abs(p.yOf(v) - y) : Infinity;
        if (away < near) { near = away; pointed = s; }
      }
    }
    if (before !== pointed) { p.read(i); redraw(); }
  };
  panels.push(p);
}

