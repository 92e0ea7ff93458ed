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
  figure.dataset.panel = name;
  const caption = document.createElement("figcaption");
  const title = document.createElement("span");
  title.className = "name";
  title.textContent = name + (unit ? ", " + unit : "");
  caption.append(title);
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  canvas.tabIndex = 0;
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
// What changes with the view and not with the cursor is kept as a picture.
function keptPicture(p, g, key, paint) {
  key = [key, view, p.canvas.width, p.canvas.height, logScale, colour.paper, colour.ink].join();
  if (key !== p.pictureKey) {
    p.pictureKey = key;
    p.picture = document.createElement("canvas");
    p.picture.width = p.canvas.width; p.picture.height = p.canvas.height;
    const s = p.picture.getContext("2d");
    s.setTransform(g.getTransform());
    paint(s);
  }
  g.save();
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.drawImage(p.picture, 0, 0);
  g.restore();
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
  if (cursor !== null && T[cursor] >= view[0] && T[cursor] <= view[1]) {
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

// Smallest positive, largest and smallest value over the view.
function extent(list) {
  const [from, to] = visible();
  let lo = Infinity, hi = -Infinity, least = Infinity;
  for (const values of list) for (let i = from; i < to; i++) {
    const v = values[i];
    if (v === v) { if (v > hi) hi = v; if (v < least) least = v; if (v > 0 && v < lo) lo = v; }
  }
  return [lo, hi, least];
}

