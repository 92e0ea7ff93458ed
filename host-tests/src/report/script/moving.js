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
// Zooms the time about one that stays where it is.
function zoomTime(t, factor) {
  setView(t - (t - view[0]) / factor, t + (view[1] - t) / factor);
}
function panTime(by) {
  const width = view[1] - view[0];
  const a = Math.min(Math.max(view[0] + by, whole[0]), whole[1] - width);
  setView(a, a + width);
}
// Fingers or buttons that are down on a canvas, by their identity.
function pinch(held, event) {
  const before = [...held.values()];
  held.set(event.pointerId, [event.offsetX, event.offsetY]);
  const after = [...held.values()];
  if (before.length !== 2 || after.length !== 2) return null;
  const apart = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  const middle = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  return { factor: apart(after) / Math.max(1, apart(before)), from: middle(before), to: middle(after) };
}
const wheelFactor = (event) => Math.exp(-Math.max(-60, Math.min(60, event.deltaY)) / 150);

function timeControls(p) {
  const held = new Map();
  const at = (event) => Math.min(view[1], Math.max(view[0], tOf(p, event.offsetX)));
  const point = (event, t) => {
    if (p.point) p.point(nearest(t), event.offsetY);
  };
  p.canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    p.canvas.setPointerCapture(event.pointerId);
    const t = at(event);
    drag = held.size === 1 ? { from: t, to: t, x: event.clientX, live: false } : null;
    point(event, t);
    setCursor(nearest(t));
  });
  p.canvas.addEventListener("pointermove", (event) => {
    const t = at(event);
    if (held.has(event.pointerId)) {
      const two = pinch(held, event);
      if (two) {
        panTime(tOf(p, two.from[0]) - tOf(p, two.to[0]));
        zoomTime(tOf(p, two.to[0]), two.factor);
        return;
      }
    }
    if (drag) {
      drag.to = t;
      if (Math.abs(event.clientX - drag.x) > 5) drag.live = true;
      if (drag.live) redraw();
    }
    point(event, t);
    setCursor(nearest(t));
  });
  p.canvas.addEventListener("pointerup", (event) => {
    held.delete(event.pointerId);
    if (drag && drag.live) {
      const [a, b] = [Math.min(drag.from, drag.to), Math.max(drag.from, drag.to)];
      drag = null;
      setView(a, b);
    }
    drag = null;
  });
  p.canvas.addEventListener("pointercancel", (event) => { held.delete(event.pointerId); drag = null; redraw(); });
  p.canvas.addEventListener("pointerleave", (event) => { if (!drag && event.pointerType === "mouse") { if (p.point) p.point(null, 0); setCursor(null); } });
  p.canvas.addEventListener("dblclick", () => setView(whole[0], whole[1]));
  p.canvas.addEventListener("wheel", (event) => {
    if (event.ctrlKey || event.metaKey) zoomTime(at(event), wheelFactor(event));
    else if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) panTime((event.deltaX || event.deltaY) / p.box.w * (view[1] - view[0]));
    else return;
    event.preventDefault();
  }, { passive: false });
}

// Track and sky: places, not times.
function placeControls(p) {
  const held = new Map();
  p.canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (p.pan) p.canvas.setPointerCapture(event.pointerId);
    look(event);
  });
  const look = (event) => {
    if (p.nearest) { const i = p.nearest(event.offsetX, event.offsetY); if (i !== null) setCursor(i); }
    if (p.pointAt) p.pointAt(event.offsetX, event.offsetY);
  };
  p.canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before || !p.pan) { look(event); return; }
    const two = pinch(held, event);
    if (two) {
      p.pan(two.to[0] - two.from[0], two.to[1] - two.from[1]);
      p.zoom(two.factor, two.to[0], two.to[1]);
    } else if (held.size === 1) p.pan(event.offsetX - before[0], event.offsetY - before[1]);
  });
  for (const name of ["pointerup", "pointercancel"]) p.canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  p.canvas.addEventListener("pointerleave", (event) => {
    if (event.pointerType !== "mouse") return;
    if (p.pointAt) p.pointAt(-1e3, -1e3);
    if (p.nearest && !held.size) setCursor(null);
  });
  if (!p.zoom) return;
  p.canvas.addEventListener("dblclick", p.reset);
  p.canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    p.zoom(wheelFactor(event), event.offsetX, event.offsetY);
    event.preventDefault();
  }, { passive: false });
}

// Keys: arrows step through the epochs (with shift: a tenth of what is shown), + and − zoom, Home shows all.
function keyControls(p) {
  p.canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const factor = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 }[event.key];
    if (way) {
      const from = cursor === null ? nearest(way > 0 ? view[0] : view[1]) : cursor;
      const i = event.shiftKey ? nearest(T[from] + way * (view[1] - view[0]) / 10) : from + way;
      setCursor(Math.min(N - 1, Math.max(0, i)));
      const t = T[cursor];
      if (t < view[0] || t > view[1]) panTime(t - (view[0] + view[1]) / 2);
    } else if (factor && p.zoom) p.zoom(factor, p.box.x + p.box.w / 2, p.box.y + p.box.h / 2);
    else if (factor) zoomTime(cursor === null ? (view[0] + view[1]) / 2 : T[cursor], factor);
    else if (event.key === "Home") { if (p.reset) p.reset(); setView(whole[0], whole[1]); }
    else if (event.key === "Escape") setCursor(null);
    else return;
    event.preventDefault();
  });
}
for (const p of panels) {
  if (p.own) placeControls(p); else if (!p.still) timeControls(p);
  keyControls(p);
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
window.addEventListener("afterprint", recolour);
recolour();
