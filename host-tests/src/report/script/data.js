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
  for (const k of ["paper", "panel", "ink", "soft", "faint", "line", "grid", "wash", "level", "error", "limit", "second", "gps", "galileo", "bds", "nominal", "excluded", "alert", "unavailable"]) colour[k] = s.getPropertyValue("--" + k).trim();
}

