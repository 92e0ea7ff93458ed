// ---- every satellite: direction, residual, C/N0 -----------------------------------------------
const systems = { G: ["GPS", "gps"], E: ["Galileo", "galileo"], C: ["BDS", "bds"] };
const skies = D.skies && D.skies.sats.length ? (() => {
  const B = D.skies.bins, each = D.skies.each;
  const i16 = (text) => new Int16Array(bytes(text));
  const u8 = (text) => new Uint8Array(bytes(text));
  const time = Float64Array.from({ length: B }, (_, k) => T[k * each]);
  const out = new Map(D.sats.map((s) => [s.id, s.out]));
  const sats = D.skies.sats.map((s) => {
    const spread = (packed, none, scale) => {
      const values = new Float32Array(B).fill(NaN);
      let at = 0;
      for (const [from, to] of s.in) for (let k = from; k < to; k++, at++) if (packed[at] !== none) values[k] = packed[at] * scale;
      return values;
    };
    const lo = spread(i16(s.lo), -32768, s.step), cLo = spread(u8(s.c), 255, 0.25);
    return {
      id: s.id,
      css: (systems[s.id[0]] || ["", "soft"])[1],
      az: spread(i16(s.az), -32768, 0.05),
      el: spread(i16(s.el), -32768, 0.05),
      residual: [lo, s.hi === undefined ? lo : spread(i16(s.hi), -32768, s.step)],
      cn0: [cLo, s.d === undefined ? cLo : spread(u8(s.d), 255, 0.25)],
      out: out.get(s.id) || [],
    };
  });
  const present = Object.keys(systems).filter((letter) => sats.some((s) => s.id[0] === letter));
  return { B, each, time, sats, present, gap: 1.6 * step * each };
})() : null;
const skyBin = (i) => Math.min(skies.B - 1, Math.floor(i / skies.each));
const isOut = (s, i) => s.out.some(([a, b]) => i >= a && i < b);

function systemKeys(caption) {
  for (const letter of skies.present) addKey(caption, systems[letter][0], systems[letter][1], "");
}

// One line per satellite, of the smallest and largest value of each bin; excluded ones in red.
function satellitePanel(parent, spec) {
  const p = makeFigure(parent, spec.name, spec.unit);
  p.height = 230;
  systemKeys(p.caption);
  if (skies.sats.some((s) => s.out.length)) addKey(p.caption, "excluded", "alert", "");
  const outPointed = addKey(p.caption, "pointed at", "ink", "");
  if (skies.each > 1) {
    const note = document.createElement("span");
    note.className = "key";
    note.textContent = "smallest and largest of every " + skies.each + " epochs";
    p.caption.append(note);
  }
  let pointed = null, yOf = null;

  function bins() {
    return [Math.max(0, Math.floor((lower(view[0]) - 1) / skies.each)), Math.min(skies.B, skyBin(Math.min(N - 1, lower(view[1]) + 1)) + 1)];
  }
  // The line of a satellite: from low to high in each half pixel, and on to the next.
  function trace(g, values, only) {
    const [from, to] = bins();
    let open = false, before = NaN, x0 = NaN, low = NaN, high = NaN;
    const flush = () => {
      if (low !== low) return;
      const a = yOf(low), b = yOf(high);
      if (open) g.lineTo(x0, a); else g.moveTo(x0 - 0.5, a);
      g.lineTo(x0, b);
      if (!open && a === b) g.lineTo(x0 + 0.5, b);
      open = true;
    };
    for (let k = from; k < to; k++) {
      const lo = values[0][k], hi = values[1][k], t = skies.time[k];
      const there = lo === lo && (!only || only(k));
      if (!there || t - before > skies.gap) { flush(); low = high = x0 = NaN; open = false; }
      before = t;
      if (!there) continue;
      const x = Math.round(xOf(p, t) * 2) / 2;
      if (x !== x0) { flush(); x0 = x; low = lo; high = hi; } else { low = Math.min(low, lo); high = Math.max(high, hi); }
    }
    flush();
  }
  function range() {
    const [from, to] = bins();
    let lo = Infinity, hi = -Infinity;
    for (const s of skies.sats) for (let k = from; k < to; k++) {
      if (spec.get(s)[0][k] < lo) lo = spec.get(s)[0][k];
      if (spec.get(s)[1][k] > hi) hi = spec.get(s)[1][k];
    }
    return lo <= hi ? [lo, hi] : [0, 1];
  }
  p.draw = () => {
    const g = prepare(p), b = p.box;
    const [lo, hi] = range();
    const scale = spec.scale(lo, hi, b);
    yOf = (v) => b.y + b.h - scale.at(v) * b.h;
    keptPicture(p, g, [lo, hi], (s) => {
      timeAxis(s, p);
      s.font = font(11);
      s.textAlign = "right";
      s.textBaseline = "middle";
      for (const v of scale.ticks) {
        const y = Math.round(yOf(v)) + 0.5;
        if (y < b.y || y > b.y + b.h) continue;
        s.strokeStyle = v === 0 ? colour.faint : colour.grid;
        s.lineWidth = 1;
        s.beginPath(); s.moveTo(b.x, y); s.lineTo(b.x + b.w, y); s.stroke();
        s.fillStyle = colour.soft;
        s.fillText(signed(v), b.x - 7, Math.min(Math.max(y, b.y + 5), b.y + b.h - 4));
      }
      s.save();
      s.beginPath(); s.rect(b.x, b.y, b.w, b.h); s.clip();
      s.lineJoin = "round";
      s.globalAlpha = skies.sats.length > 12 ? 0.65 : 0.9;
      s.lineWidth = 1;
      for (const sat of skies.sats) { s.strokeStyle = colour[sat.css]; s.beginPath(); trace(s, spec.get(sat)); s.stroke(); }
      s.globalAlpha = 1;
      const labels = [];
      for (const sat of skies.sats) if (sat.out.length) {
        s.strokeStyle = colour.alert;
        s.lineWidth = 2;
        s.beginPath(); trace(s, spec.get(sat), (k) => outInBin(sat, k)); s.stroke();
        const [from, to] = bins();
        let best = -1, size = -1;
        for (let k = from; k < to; k++) {
          if (!outInBin(sat, k) || skies.time[k] < view[0] || skies.time[k] > view[1]) continue;
          const v = Math.max(Math.abs(spec.get(sat)[0][k]), Math.abs(spec.get(sat)[1][k]));
          if (v > size) { size = v; best = k; }
        }
        if (best >= 0) labels.push([sat.id, xOf(p, skies.time[best]), yOf(Math.abs(spec.get(sat)[0][best]) >= size ? spec.get(sat)[0][best] : spec.get(sat)[1][best])]);
      }
      nameMarks(s, b, labels, "alert");
      s.restore();
      frame(s, p);
    });
    if (pointed) {
      g.save();
      g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip();
      g.strokeStyle = colour.ink;
      g.lineWidth = 2;
      g.beginPath(); trace(g, spec.get(pointed)); g.stroke();
      const v = cursor === null ? NaN : spec.get(pointed)[1][skyBin(cursor)];
      if (v === v) nameMarks(g, b, [[pointed.id, xOf(p, T[cursor]), yOf(v)]], "ink");
      g.restore();
    }
    overlay(g, p);
  };
  function tell(s, k) {
    const lo = spec.get(s)[0][k], hi = spec.get(s)[1][k];
    if (!(lo === lo)) return "–";
    return (lo === hi ? signed(lo, 2) : signed(lo, 2) + " to " + signed(hi, 2)) + "\u2009" + spec.unit;
  }
  p.read = (i) => { outPointed.textContent = i === null || !pointed ? "" : pointed.id + "\u2002" + tell(pointed, skyBin(i)); };
  p.point = (i, y) => {
    const before = pointed;
    pointed = null;
    if (i !== null && yOf) {
      const k = skyBin(i);
      let near = 16;
      for (const s of skies.sats) {
        const [lo, hi] = spec.get(s).map((values) => yOf(values[k]));
        if (!(lo === lo)) continue;
        const away = y > lo ? y - lo : y < hi ? hi - y : 0;
        if (away < near) { near = away; pointed = s; }
      }
    }
    if (before !== pointed) { p.read(i); redraw(); }
  };
  panels.push(p);
}
const outInBin = (s, k) => s.out.some(([a, b]) => a < (k + 1) * skies.each && b > k * skies.each);
function signed(v, digits) {
  const text = digits === undefined ? String(Number(Math.abs(v).toPrecision(3))) : Math.abs(v).toFixed(digits);
  return (v < 0 ? "−" : "") + text;
}
// Names beside marks, moved down where they would lie on each other.
function nameMarks(g, b, labels, css) {
  g.font = "600 " + font(11);
  g.textBaseline = "middle";
  const placed = [];
  for (const [text, x, y] of labels) {
    const right = x < b.x + b.w - 40;
    let yy = Math.min(Math.max(y, b.y + 8), b.y + b.h - 8);
    while (placed.some(([px, py]) => Math.abs(px - x) < 34 && Math.abs(py - yy) < 12)) yy += 12;
    placed.push([x, yy]);
    g.fillStyle = colour[css];
    g.fillRect(x - 2, y - 2, 4, 4);
    g.textAlign = right ? "left" : "right";
    g.lineWidth = 3;
    g.strokeStyle = colour.paper;
    g.strokeText(text, right ? x + 6 : x - 6, yy);
    g.fillText(text, right ? x + 6 : x - 6, yy);
  }
}
// Metres about zero: linear to one metre, logarithmic beyond, so that a fault of 60 m leaves the others readable.
function residualScale(lo, hi) {
  const most = Math.max(1, Math.abs(lo), Math.abs(hi)) * 1.08;
  const f = logScale ? Math.asinh : (v) => v;
  const marks = logScale ? [0, 0.5, 1, 2, 5, 10, 30, 100, 300, 1e3, 1e4, 1e5].filter((v) => v <= most) : niceSteps(0, most, 4);
  const span = f(most);
  // As many as have room.
  const kept = [];
  for (const v of marks) if (!kept.length || f(v) / span - f(kept[kept.length - 1]) / span > 0.11) kept.push(v);
  return { at: (v) => 0.5 + 0.5 * f(v) / span, ticks: [...kept.filter((v) => v > 0).map((v) => -v), ...kept] };
}
function cn0Scale(lo, hi) {
  const bottom = Math.floor((lo - 1) / 5) * 5, top = Math.ceil((hi + 1) / 5) * 5;
  return { at: (v) => (v - bottom) / (top - bottom), ticks: niceSteps(bottom, top, 5) };
}
