"use strict";
(() => {
  // ---- data ---------------------------------------------------------------------------------
  const D = JSON.parse(document.getElementById("data").textContent);
  const N = D.n;

  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  function column(c) {
    if (c.f !== undefined) return new Float32Array(bytes(c.f));
    const out = new Float32Array(N);
    let at = 0;
    for (const [count, value] of c.r) {
      out.fill(value === null ? NaN : value, at, at + count);
      at += count;
    }
    return out;
  }
  function times(c) {
    if (c.d !== undefined) return new Float64Array(bytes(c.d));
    return Float64Array.from({ length: N }, (_, i) => c.u[0] + c.u[1] * i);
  }
  const T = times(D.t);
  const col = {};
  for (const k of ["week", "state", "reason", "hpl", "vpl", "hal", "val", "stat", "thr", "nsat", "nvis", "e", "nn", "u", "uh", "uv", "nbank", "opinion"]) col[k] = column(D[k]);
  const map = (f) => Float32Array.from({ length: N }, (_, i) => f(i));
  col.he = map((i) => Math.hypot(col.e[i], col.nn[i]));
  col.ve = map((i) => Math.abs(col.u[i]));
  const some = (a) => a.some((v) => v === v);

  // An interval longer than this between epochs is a gap and breaks a line.
  const step = (() => {
    if (N < 2) return 1;
    const d = Array.from({ length: Math.min(N - 1, 2000) }, (_, i) => T[i + 1] - T[i]).sort((a, b) => a - b);
    return d[d.length >> 1];
  })();
  const whole = [T[0], T[N - 1] > T[0] ? T[N - 1] : T[0] + 1];
  let view = whole.slice();
  let cursor = null;
  let logScale = true;

  // First index whose time is t or later.
  function lower(t) {
    let a = 0, b = N;
    while (a < b) { const m = (a + b) >> 1; if (T[m] < t) a = m + 1; else b = m; }
    return a;
  }

  // ---- words --------------------------------------------------------------------------------
  const two = (v) => String(v).padStart(2, "0");
  function clock(s, digits) {
    const sign = s < 0 ? "−" : "";
    s = Math.abs(s);
    let whole = Math.floor(s + 1e-9);
    const fraction = digits ? (s - whole).toFixed(digits).slice(1) : "";
    return sign + two(Math.floor(whole / 3600)) + ":" + two(Math.floor(whole / 60) % 60) + ":" + two(whole % 60) + fraction;
  }
  const timeDigits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
  function number(v) {
    if (!(v === v)) return "–";
    const a = Math.abs(v);
    if (a >= 1000) return v.toFixed(0);
    if (a >= 100) return v.toFixed(1);
    if (a >= 0.01 || a === 0) return v.toFixed(2);
    return v.toExponential(1);
  }
  const words = (s) => s.replace(/_/g, " ").replace(/\b(hpl|vpl)\b/g, (m) => m.toUpperCase());

  // ---- colours ------------------------------------------------------------------------------
  let colour = {};
  function readColours() {
    const s = getComputedStyle(document.documentElement);
    for (const k of ["paper", "panel", "ink", "soft", "faint", "line", "grid", "wash", "level", "error", "limit", "second", "nominal", "excluded", "alert", "unavailable"]) colour[k] = s.getPropertyValue("--" + k).trim();
  }

  // ---- a panel ------------------------------------------------------------------------------
  const LEFT = 58, RIGHT = 10, TOP = 6, BOTTOM = 20;
  const panels = [];
  const font = (px) => px + "px system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";

  function niceSteps(lo, hi, count) {
    const raw = (hi - lo) / count;
    const power = Math.pow(10, Math.floor(Math.log10(raw)));
    const m = [1, 2, 5, 10].find((k) => k * power >= raw) * power;
    const out = [];
    for (let v = Math.ceil(lo / m) * m; v <= hi + m * 1e-9; v += m) out.push(Math.abs(v) < m * 1e-9 ? 0 : v);
    return out;
  }
  const timeSteps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
  function timeTicks(width) {
    const span = view[1] - view[0];
    const wanted = Math.max(2, Math.floor(width / 90));
    const m = timeSteps.find((s) => span / s <= wanted) || 86400 * Math.ceil(span / 86400 / wanted);
    const out = [];
    for (let k = Math.ceil(view[0] / m - 1e-9); k * m <= view[1] + m * 1e-9; k++) out.push(k * m);
    return { ticks: out, digits: m < 1 ? 1 : 0 };
  }

  function makeFigure(parent, name, unit) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const title = document.createElement("span");
    title.className = "name";
    title.textContent = name + (unit ? ", " + unit : "");
    caption.append(title);
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", name + (unit ? " in " + unit : "") + " over time");
    figure.append(caption, canvas);
    parent.append(figure);
    return { figure, caption, canvas };
  }
  function addKey(caption, text, cssColour, kind) {
    const key = document.createElement("span");
    key.className = "key";
    const mark = document.createElement("i");
    if (kind) mark.className = kind;
    if (kind === "block") mark.style.background = "var(--" + cssColour + ")";
    else mark.style.borderTopColor = "var(--" + cssColour + ")";
    const value = document.createElement("b");
    key.append(mark, text, value);
    caption.append(key);
    return value;
  }

  function prepare(p) {
    const ratio = window.devicePixelRatio || 1;
    const width = p.canvas.clientWidth, height = p.height;
    p.canvas.style.height = height + "px";
    p.canvas.width = Math.round(width * ratio);
    p.canvas.height = Math.round(height * ratio);
    const g = p.canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    p.box = { x: LEFT, y: TOP, w: Math.max(10, width - LEFT - RIGHT), h: height - TOP - BOTTOM };
    return g;
  }
  const xOf = (p, t) => p.box.x + (t - view[0]) / (view[1] - view[0]) * p.box.w;
  const tOf = (p, x) => view[0] + (x - p.box.x) / p.box.w * (view[1] - view[0]);

  function timeAxis(g, p) {
    const b = p.box;
    const { ticks, digits } = timeTicks(b.w);
    g.font = font(11);
    g.textBaseline = "top";
    g.textAlign = "center";
    g.lineWidth = 1;
    for (const t of ticks) {
      const x = Math.round(xOf(p, t)) + 0.5;
      if (x < b.x - 1 || x > b.x + b.w + 1) continue;
      g.strokeStyle = colour.grid;
      g.beginPath(); g.moveTo(x, b.y); g.lineTo(x, b.y + b.h); g.stroke();
      g.fillStyle = colour.soft;
      const text = clock(t, digits);
      const half = g.measureText(text).width / 2;
      g.fillText(text, Math.min(Math.max(x, b.x + half - 20), b.x + b.w - half + 8), b.y + b.h + 5);
    }
  }
  function frame(g, p) {
    const b = p.box;
    g.strokeStyle = colour.line;
    g.lineWidth = 1;
    g.strokeRect(b.x + 0.5, b.y + 0.5, b.w - 1, b.h - 1);
  }
  function overlay(g, p) {
    const b = p.box;
    if (cursor !== null) {
      const x = Math.round(xOf(p, T[cursor])) + 0.5;
      if (x >= b.x && x <= b.x + b.w) {
        g.strokeStyle = colour.soft;
        g.setLineDash([2, 2]);
        g.beginPath(); g.moveTo(x, b.y); g.lineTo(x, b.y + b.h); g.stroke();
        g.setLineDash([]);
      }
    }
    if (drag && drag.live) {
      g.globalAlpha = 0.14;
      g.fillStyle = colour.level;
      const x0 = xOf(p, drag.from), x1 = xOf(p, drag.to);
      g.fillRect(Math.min(x0, x1), b.y, Math.abs(x1 - x0), b.h);
      g.globalAlpha = 1;
    }
  }

  // Epochs of the view, one more on either side so that lines reach the edge.
  function visible() {
    return [Math.max(0, lower(view[0]) - 1), Math.min(N, lower(view[1]) + 2)];
  }

  function drawLine(g, p, values, yOf, style) {
    const [from, to] = visible();
    const b = p.box;
    g.save();
    g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip();
    g.strokeStyle = g.fillStyle = style.colour;
    g.lineWidth = style.width || 1.25;
    g.lineJoin = "round";
    if (style.dash) g.setLineDash(style.dash);
    g.beginPath();
    const lone = [];
    if (to - from > 3 * b.w) {
      // More epochs than columns: a band from the smallest to the largest value of each column,
      // and their mean as the line.
      const columns = [];
      let c = null, before = NaN, broken = true;
      for (let i = from; i < to; i++) {
        const v = values[i];
        if (!(v === v)) { broken = true; continue; }
        if (T[i] - before > 1.6 * step) broken = true;
        before = T[i];
        const x = Math.round(xOf(p, T[i]) * 2) / 2;
        if (!c || c.x !== x || broken) { c = { x, lo: v, hi: v, sum: 0, n: 0, broken }; columns.push(c); }
        if (v < c.lo) c.lo = v;
        if (v > c.hi) c.hi = v;
        c.sum += v;
        c.n++;
        broken = false;
      }
      g.globalAlpha = 0.3;
      for (const k of columns) {
        const top = yOf(k.hi), bottom = yOf(k.lo);
        if (bottom - top > 1) g.fillRect(k.x - 0.25, top, 0.5, bottom - top);
      }
      g.globalAlpha = 1;
      columns.forEach((k, at) => {
        const y = yOf(k.sum / k.n);
        if (k.broken) {
          g.moveTo(k.x, y);
          if (at + 1 === columns.length || columns[at + 1].broken) lone.push([k.x, y]);
        } else g.lineTo(k.x, y);
      });
    } else {
      let open = false;
      for (let i = from; i < to; i++) {
        const v = values[i];
        if (!(v === v)) { open = false; continue; }
        const x = xOf(p, T[i]), y = yOf(v);
        const joined = i > from && values[i - 1] === values[i - 1] && T[i] - T[i - 1] <= 1.6 * step;
        if (open && joined) {
          if (style.steps) g.lineTo(x, yOf(values[i - 1]));
          g.lineTo(x, y);
        } else {
          g.moveTo(x, y);
          const next = i + 1 < to && values[i + 1] === values[i + 1] && T[i + 1] - T[i] <= 1.6 * step;
          if (!next) lone.push([x, y]);
        }
        open = true;
      }
    }
    g.stroke();
    g.setLineDash([]);
    for (const [x, y] of lone) g.fillRect(x - 1, y - 1, 2, 2);
    g.restore();
  }

  // Smallest positive and largest value over the view.
  function extent(list) {
    const [from, to] = visible();
    let lo = Infinity, hi = -Infinity;
    for (const values of list) for (let i = from; i < to; i++) {
      const v = values[i];
      if (v === v) { if (v > hi) hi = v; if (v > 0 && v < lo) lo = v; }
    }
    return [lo, hi];
  }

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
      let [lo, hi] = extent(main.length ? main : p.values.map((l) => l.values));
      const limits = extent(p.values.filter((l) => l.limit).map((l) => l.values));
      if (!(hi > -Infinity)) { lo = 0; hi = 1; }
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
        const text = v >= 1000 ? v.toLocaleString("en").replace(/,/g, "\u2009") : String(Number(v.toPrecision(3)));
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

  // Error against level: the diagram of Stanford, of the whole run, counted in cells.
  function stanford(parent, name, data, error, level) {
    const p = makeFigure(parent, name, "m");
    p.figure.className = "still";
    p.canvas.setAttribute("aria-label", name + ": error against protection level");
    p.height = 360;
    const cells = [];
    for (let k = 0; k < data.cells.length; k += 4) cells.push(data.cells.slice(k, k + 4));
    const most = cells.reduce((m, c) => Math.max(m, c[3]), 1);
    const al = data.limit === null ? NaN : data.limit;
    const counts = document.createElement("span");
    counts.className = "key line";
    const [normal, unavailable, misleading, both, hazardous] = data.regions;
    const list = [["normal operation", normal]];
    if (al === al) list.push(["system unavailable", unavailable]);
    list.push(["misleading", misleading]);
    if (al === al) list.push(["hazardously misleading", hazardous]);
    if (both) list.push(["unavailable and misleading", both]);
    if (data.alerted) list.push(["at alert, not drawn", data.alerted]);
    if (data.without) list.push(["without a level", data.without]);
    counts.textContent = "epochs: " + list.map(([text, n]) => n + "\u00a0" + text.replace(/ /g, "\u00a0")).join(" · ");
    p.caption.append(counts);
    // The axes: all cells, the limit, and a little more; at most four decades.
    let top = 0.1, bottom = Infinity;
    for (const [e, l] of cells) {
      top = Math.max(top, Math.pow(10, (Math.max(e, l) + 1) / data.per));
      bottom = Math.min(bottom, Math.pow(10, Math.min(e, l) / data.per));
    }
    if (al === al) top = Math.max(top, al * 2.5);
    const hi = Math.pow(10, Math.ceil(Math.log10(top * 1.1) * 4) / 4);
    const lo = Math.pow(10, Math.floor(Math.log10(Math.max(Math.min(bottom, top / 10), hi / 1e4)) * 2) / 2);
    p.draw = () => {
      const g = prepare(p), b = p.box;
      b.h -= 32;
      b.y += 18;
      const span = Math.log(hi / lo);
      const X = (v) => b.x + Math.log(Math.max(v, lo) / lo) / span * b.w;
      const Y = (v) => b.y + b.h - Math.log(Math.max(v, lo) / lo) / span * b.h;
      const right = b.x + b.w, low = b.y + b.h;
      const area = (css, alpha, corners) => {
        g.fillStyle = colour[css];
        g.globalAlpha = alpha;
        g.beginPath();
        corners.forEach(([x, y], k) => { if (k) g.lineTo(x, y); else g.moveTo(x, y); });
        g.fill();
        g.globalAlpha = 1;
      };
      const diagonal = (v) => [X(v), Y(v)];
      if (al === al) {
        area("unavailable", 0.13, [[b.x, Y(al)], [b.x, b.y], diagonal(hi), diagonal(al)]);
        area("excluded", 0.13, [diagonal(lo), diagonal(al), [X(al), low]]);
        area("excluded", 0.22, [diagonal(al), diagonal(hi), [right, Y(al)]]);
        area("alert", 0.2, [[X(al), low], diagonal(al), [right, Y(al)], [right, low]]);
      } else area("excluded", 0.13, [diagonal(lo), diagonal(hi), [right, low]]);
      g.font = font(11);
      for (let e = Math.floor(Math.log10(lo)); e <= Math.log10(hi); e++) for (const m of [1, 3]) {
        const v = m * Math.pow(10, e);
        if (v < lo * 0.999 || v > hi) continue;
        g.strokeStyle = colour.grid;
        g.lineWidth = 1;
        g.beginPath(); g.moveTo(X(v), b.y); g.lineTo(X(v), low); g.moveTo(b.x, Y(v)); g.lineTo(right, Y(v)); g.stroke();
        if (m !== 1 && b.w < 60 * Math.log10(hi / lo)) continue;
        g.fillStyle = colour.soft;
        const text = String(Number(v.toPrecision(1)));
        g.textAlign = "center"; g.textBaseline = "top";
        g.fillText(text, X(v), low + 4);
        g.textAlign = "right"; g.textBaseline = "middle";
        g.fillText(text, b.x - 7, Y(v));
      }
      g.save();
      g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip();
      // The more epochs, the darker, by the logarithm; errors above the level come last and in red.
      for (const above of [0, 1]) for (const [e, l, over, n] of cells) {
        if (over !== above) continue;
        const v = (k) => Math.pow(10, k / data.per);
        let x0 = X(v(e)), x1 = X(v(e + 1));
        const y0 = Y(v(l + 1)), y1 = Y(v(l));
        // Below the axis: a cell on its edge.
        if (x1 <= b.x + 0.5) { x0 = b.x; x1 = b.x + (X(v(1)) - X(v(0))); }
        // One epoch above its level has to be seen.
        g.globalAlpha = over ? 0.6 + 0.4 * shade(n) : shade(n);
        g.fillStyle = over ? colour.alert : colour.level;
        g.fillRect(x0, y0, Math.max(2, x1 - x0 + 0.3), Math.max(2, y1 - y0 + 0.3));
      }
      g.globalAlpha = 1;
      g.strokeStyle = colour.soft;
      g.lineWidth = 1;
      g.beginPath(); g.moveTo(X(lo), Y(lo)); g.lineTo(X(hi), Y(hi)); g.stroke();
      if (al === al) {
        g.strokeStyle = colour.limit;
        g.setLineDash([5, 3]);
        g.beginPath(); g.moveTo(b.x, Y(al)); g.lineTo(right, Y(al)); g.moveTo(X(al), low); g.lineTo(X(al), Y(al)); g.stroke();
        g.setLineDash([]);
      }
      g.restore();
      frame(g, p);
      // Names of the parts, in words that fit them.
      const label = (lines, x, y, align, css) => {
        g.font = "600 " + font(11);
        g.textAlign = align;
        g.textBaseline = "middle";
        lines.forEach((text, k) => {
          const at = y + (k - (lines.length - 1) / 2) * 13;
          g.lineWidth = 3;
          g.strokeStyle = colour.paper;
          g.globalAlpha = 0.75;
          g.strokeText(text, x, at);
          g.globalAlpha = 1;
          g.fillStyle = colour[css];
          g.fillText(text, x, at);
        });
      };
      if (al === al) {
        if (Y(al) - b.y > 16) label(["system unavailable"], b.x + 8, b.y + 12, "left", "soft");
        label(["normal", "operation"], b.x + 8, Y(al) + 0.36 * (low - Y(al)), "left", "nominal");
        if (X(al) - b.x > 110) label(["misleading", "information"], X(al) - 8, low - 20, "right", "second");
        if (right - X(al) > 190) label(["hazardously misleading information"], right - 6, low - 20, "right", "alert");
        else if (right - X(al) > 92) label(["hazardously", "misleading", "information"], right - 6, low - 28, "right", "alert");
        else {
          // Upwards in a narrow strip.
          g.save();
          g.translate((X(al) + right) / 2, low - 8);
          g.rotate(-Math.PI / 2);
          label(["hazardously misleading", "information"], 0, 0, "left", "alert");
          g.restore();
        }
      } else {
        label(["normal operation"], b.x + 8, b.y + 14, "left", "nominal");
        label(["misleading", "information"], right - 8, low - 30, "right", "second");
      }
      g.font = font(11);
      g.fillStyle = colour.soft;
      g.textAlign = "center"; g.textBaseline = "top";
      g.fillText("error, m", b.x + b.w / 2, low + 18);
      g.textAlign = "left"; g.textBaseline = "top";
      g.fillText("level, m", b.x, TOP - 1);
      // What a colour stands for.
      const steps = 24, barW = 72, barX = right - barW - 30;
      for (let k = 0; k < steps; k++) {
        g.globalAlpha = shade(Math.pow(most, (k + 0.5) / steps));
        g.fillStyle = colour.level;
        g.fillRect(barX + k * barW / steps, TOP, barW / steps + 0.3, 9);
      }
      g.globalAlpha = 1;
      g.fillStyle = colour.soft;
      g.textAlign = "right";
      g.fillText("epochs 1", barX - 4, TOP - 1);
      g.textAlign = "left";
      g.fillText(String(most), barX + barW + 4, TOP - 1);
      if (cursor !== null && error[cursor] === error[cursor] && level[cursor] === level[cursor]) {
        g.strokeStyle = colour.ink;
        g.lineWidth = 1.5;
        g.beginPath(); g.arc(X(error[cursor]), Y(level[cursor]), 4, 0, 7); g.stroke();
      }
    };
    const shade = (n) => (most > 1 ? 0.22 + 0.78 * Math.log(n) / Math.log(most) : 0.8);
    p.read = () => {};
    p.still = true;
    panels.push(p);
  }

  // ---- the page -----------------------------------------------------------------------------
  const main = document.getElementById("panels");
  const stateOrder = ["nominal", "excluded", "alert", "unavailable"];
  const stateRows = stateOrder.map((s) => {
    const k = D.states.indexOf(s);
    return { label: s === "unavailable" ? "unavail." : s, layers: [{ css: s, ranges: k < 0 ? [] : rangesWhere((i) => col.state[i] === k), inset: 2 }] };
  });
  // Reasons have rows a, b, … below the states; the caption says which is which.
  const reasonNames = [];
  D.reasons.forEach((r, k) => {
    if (r === "none" || r === "") return;
    const letter = String.fromCharCode(97 + reasonNames.length);
    stateRows.push({ label: letter, rule: !reasonNames.length, layers: [{ css: "soft", ranges: rangesWhere((i) => col.reason[i] === k), inset: 4 }] });
    reasonNames.push(letter + "\u2002" + words(r));
  });
  const reasonAt = (i) => { const r = D.reasons[col.reason[i]]; return r === "none" || r === "" ? "" : words(r); };
  stripPanel(main, {
    name: "Integrity", rowHeight: 15, rows: stateRows, legend: reasonNames,
    read: (i) => D.states[col.state[i]] + (reasonAt(i) ? ": " + reasonAt(i) : ""),
  });

  // Two opinions, where there are two: the snapshot's and the bank's.
  const opinionOrder = [["agree", "nominal"], ["snapshot_only", "excluded"], ["bank_only", "level"], ["snapshot_abstains", "unavailable"]];
  if (D.opinions.some((o) => o !== "")) {
    const rows = opinionOrder.map(([name, css]) => {
      const k = D.opinions.indexOf(name);
      const label = { agree: "agree", snapshot_only: "snapshot", bank_only: "bank", snapshot_abstains: "abstains" }[name];
      return { label, layers: [{ css, ranges: k < 0 ? [] : rangesWhere((i) => col.opinion[i] === k), inset: 2 }] };
    });
    stripPanel(main, {
      name: "Two opinions", rowHeight: 13, rows,
      legend: ["snapshot and bank agree", "a fault seen by the snapshot only", "by the bank only", "the snapshot has nothing to test"],
      read: (i) => words(D.opinions[col.opinion[i]]),
    });
  }

  linePanel(main, {
    name: "Horizontal", unit: "m", log: true, note: D.truth ? "" : "no truth given",
    lines: [
      { name: "alert limit", values: col.hal, css: "limit", dash: [6, 4], limit: true, width: 1 },
      { name: "HPL", values: col.hpl, css: "level", width: 1.5 },
      { name: "uncertainty at alert", values: col.uh, css: "second", width: 1.5 },
      { name: "error", values: col.he, css: "error", width: 1 },
    ],
  });
  linePanel(main, {
    name: "Vertical", unit: "m", log: true, note: D.truth ? "" : "no truth given",
    lines: [
      { name: "alert limit", values: col.val, css: "limit", dash: [6, 4], limit: true, width: 1 },
      { name: "VPL", values: col.vpl, css: "level", width: 1.5 },
      { name: "uncertainty at alert", values: col.uv, css: "second", width: 1.5 },
      { name: "error", values: col.ve, css: "error", width: 1 },
    ],
  });
  if (bank) {
    ratioPanel(main, "Bank: statistic over threshold, horizontal", 0);
    ratioPanel(main, "Bank: statistic over threshold, vertical", 1);
  }
  linePanel(main, {
    name: "Test statistic of the snapshot", unit: "1", log: true, height: 160,
    lines: [
      { name: "threshold", values: col.thr, css: "limit", dash: [6, 4], width: 1, steps: true },
      { name: "statistic", values: col.stat, css: "error", width: 1 },
    ],
  });
  linePanel(main, {
    name: "Satellites", unit: "", log: false, height: 110, whole: true,
    lines: [
      { name: "received", values: col.nvis, css: "soft", width: 1, steps: true },
      { name: "used", values: col.nsat, css: "level", width: 1.5, steps: true },
      { name: "in the bank", values: col.nbank, css: "second", width: 1, steps: true },
    ],
  });
  if (D.sats.length) {
    let before = "";
    const rows = D.sats.map((s) => {
      const rule = s.id[0] !== before;
      before = s.id[0];
      return { label: s.id, rule, layers: [{ css: "level", ranges: unbroken(s.used) }, { css: "alert", ranges: unbroken(s.out), inset: 1 }] };
    });
    const inRange = (ranges, i) => ranges.some(([a, b]) => i >= a && i < b);
    stripPanel(main, {
      name: D.hasUsed ? "Satellites used and excluded" : "Satellites excluded",
      rowHeight: 12, rows,
      keys: D.hasUsed ? [["used", "level"], ["excluded", "alert"]] : [["excluded", "alert"]],
      read: (i) => {
        const out = D.sats.filter((s) => inRange(s.out, i)).map((s) => s.id);
        return out.length ? "excluded " + out.join(" ") : "";
      },
    });
  }
  if (D.truth) {
    const pair = document.createElement("div");
    pair.className = "pair";
    main.append(pair);
    stanford(pair, "Horizontal: level against error", D.stanford[0], col.he, col.hpl);
    stanford(pair, "Vertical: level against error", D.stanford[1], col.ve, col.vpl);
  }

  // ---- moving about -------------------------------------------------------------------------
  const output = document.getElementById("cursor");
  const help = output.textContent;
  const resetButton = document.getElementById("reset");
  const scaleButton = document.getElementById("scale");
  let drag = null;
  let queued = false;
  function redraw() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(() => { queued = false; drawAll(); });
  }
  function drawAll() {
    for (const p of panels) p.draw();
    resetButton.disabled = view[0] === whole[0] && view[1] === whole[1];
  }
  function setCursor(i) {
    if (cursor === i) return;
    cursor = i;
    for (const p of panels) p.read(i);
    output.replaceChildren();
    if (i === null) {
      output.textContent = help;
    } else {
      const time = document.createElement("b");
      time.textContent = clock(T[i], timeDigits);
      output.append(time);
      if (D.tow0 !== null) {
        const tow = (D.tow0 + T[i] - T[0]) % 604800;
        output.append(" · week " + col.week[i] + ", " + tow.toFixed(timeDigits) + " s · ");
      } else output.append(" · ");
      const state = document.createElement("b");
      state.textContent = D.states[col.state[i]];
      output.append(state);
      const reason = D.reasons[col.reason[i]];
      if (reason !== "none" && reason !== "") output.append(": " + words(reason));
      if (col.nsat[i] === col.nsat[i]) output.append(" · " + col.nsat[i] + " satellites");
    }
    redraw();
  }
  function nearest(t) {
    const k = lower(t);
    if (k <= 0) return 0;
    if (k >= N) return N - 1;
    return t - T[k - 1] < T[k] - t ? k - 1 : k;
  }
  function setView(a, b) {
    const least = Math.max(step * 4, 1e-3);
    if (b - a < least) { const m = (a + b) / 2; a = m - least / 2; b = m + least / 2; }
    view = [Math.max(whole[0], a), Math.min(whole[1], b)];
    if (!(view[1] > view[0])) view = whole.slice();
    redraw();
  }
  for (const p of panels) {
    if (p.still) continue;
    const at = (event) => {
      const x = event.clientX - p.canvas.getBoundingClientRect().left;
      return Math.min(view[1], Math.max(view[0], tOf(p, x)));
    };
    const point = (event, t) => {
      if (p.point) p.point(nearest(t), event.clientY - p.canvas.getBoundingClientRect().top);
    };
    p.canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      const t = at(event);
      drag = { from: t, to: t, x: event.clientX, live: false };
      p.canvas.setPointerCapture(event.pointerId);
      point(event, t);
      setCursor(nearest(t));
    });
    p.canvas.addEventListener("pointermove", (event) => {
      const t = at(event);
      if (drag) {
        drag.to = t;
        if (Math.abs(event.clientX - drag.x) > 5) drag.live = true;
        if (drag.live) redraw();
      }
      point(event, t);
      setCursor(nearest(t));
    });
    p.canvas.addEventListener("pointerup", () => {
      if (drag && drag.live) {
        const [a, b] = [Math.min(drag.from, drag.to), Math.max(drag.from, drag.to)];
        drag = null;
        setView(a, b);
      }
      drag = null;
    });
    p.canvas.addEventListener("pointercancel", () => { drag = null; redraw(); });
    p.canvas.addEventListener("pointerleave", (event) => { if (!drag && event.pointerType === "mouse") { if (p.point) p.point(null, 0); setCursor(null); } });
    p.canvas.addEventListener("dblclick", () => setView(whole[0], whole[1]));
  }
  resetButton.addEventListener("click", () => setView(whole[0], whole[1]));
  scaleButton.addEventListener("click", () => {
    logScale = !logScale;
    scaleButton.textContent = logScale ? "linear scale" : "logarithmic scale";
    redraw();
  });
  const recolour = () => { readColours(); drawAll(); };
  window.addEventListener("resize", redraw);
  for (const query of ["(prefers-color-scheme: dark)", "print"]) window.matchMedia(query).addEventListener("change", recolour);
  recolour();
})();
