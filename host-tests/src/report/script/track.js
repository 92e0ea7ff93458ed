// ---- the track on a local grid ----------------------------------------------------------------
const track = D.track && (() => {
  const e = column(D.track.e), n = column(D.track.n), h = column(D.track.h);
  // The error is the position minus the truth.
  const te = map((i) => e[i] - col.e[i]), tn = map((i) => n[i] - col.nn[i]), th = map((i) => h[i] - col.u[i]);
  return { e, n, h, te, tn, th };
})();

function trackPanel(parent) {
  const p = makeFigure(parent, "Track, local grid", "m");
  p.canvas.setAttribute("aria-label", "track, east and north of the first position in metres");
  p.figure.className = "map";
  p.height = 440;
  p.own = true;
  for (const s of D.states) addKey(p.caption, s, s, "");
  // What is in sight: centre and metres per pixel; null shows all of it.
  let sight = null;
  const bounds = (() => {
    let [w, s, e, n] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < N; i++) for (const [x, y] of [[track.e[i], track.n[i]], [track.te[i], track.tn[i]]]) {
      if (x < w) w = x;
      if (x > e) e = x;
      if (y < s) s = y;
      if (y > n) n = y;
    }
    return { w, s, e, n };
  })();
  // Positions of a fixed antenna are a cloud: lines through it would hide it.
  const isCloud = (() => {
    let way = 0;
    for (let i = 1; i < N; i++) { const d = Math.hypot(track.e[i] - track.e[i - 1], track.n[i] - track.n[i - 1]); if (d === d) way += d; }
    return way > 15 * Math.hypot(bounds.e - bounds.w, bounds.n - bounds.s);
  })();
  if (D.truth) addKey(p.caption, isCloud ? "truth: +" : "truth", "ink", "dash");
  const origin = document.createElement("span");
  origin.className = "key line";
  const angle = (v, plus, minus) => Math.abs(v).toFixed(6) + "° " + (v < 0 ? minus : plus);
  origin.textContent = "0, 0 is the first position, " + angle(D.track.lat, "N", "S") + " " + angle(D.track.lon, "E", "W") + "; ring: HPL at the cursor";
  p.caption.append(origin);
  const readout = document.createElement("span");
  readout.className = "key";
  const value = document.createElement("b");
  readout.append(value);
  p.caption.append(readout);

  const fit = (b) => {
    const scale = Math.max((bounds.e - bounds.w) / (b.w - 40), (bounds.n - bounds.s) / (b.h - 40), 1e-3);
    return { e: (bounds.e + bounds.w) / 2, n: (bounds.n + bounds.s) / 2, scale };
  };
  const now = () => sight || fit(p.box);
  const xy = (e, n) => { const s = now(), b = p.box; return [b.x + b.w / 2 + (e - s.e) / s.scale, b.y + b.h / 2 - (n - s.n) / s.scale]; };

  // Pieces of a line, without points less than half a pixel from the one before.
  function line(g, east, north, from, to, css) {
    let before = null, last = -1, open = false;
    const begin = () => { g.beginPath(); open = false; };
    begin();
    let now = null;
    for (let i = from; i < to; i++) {
      if (!(east[i] === east[i])) { last = -1; continue; }
      const [x, y] = xy(east[i], north[i]);
      const joined = last >= 0 && T[i] - T[last] <= 1.6 * step;
      const style = css(i);
      if (style !== now) {
        g.stroke();
        begin();
        now = style;
        g.strokeStyle = colour[style];
        if (joined && before) { g.moveTo(before[0], before[1]); open = true; }
      }
      if (!joined || !open) { g.moveTo(x, y); g.lineTo(x + 0.1, y); open = true; before = [x, y]; }
      else if (Math.abs(x - before[0]) + Math.abs(y - before[1]) >= 0.5) { g.lineTo(x, y); before = [x, y]; }
      last = i;
    }
    g.stroke();
  }
  function dots(g, from, to, css) {
    const seen = new Set();
    const size = to - from > 20000 ? 1.5 : 2.5;
    for (let i = from; i < to; i++) {
      if (!(track.e[i] === track.e[i])) continue;
      const [x, y] = xy(track.e[i], track.n[i]);
      const style = css(i), key = style + Math.round(x) + "," + Math.round(y);
      if (seen.has(key)) continue;
      seen.add(key);
      g.fillStyle = colour[style];
      g.fillRect(x - size / 2, y - size / 2, size, size);
    }
  }
  function grid(g) {
    const b = p.box, s = now();
    const half = { e: b.w / 2 * s.scale, n: b.h / 2 * s.scale };
    const wanted = Math.max(3, Math.floor(b.w / 95));
    const [first, second] = niceSteps(s.e - half.e, s.e + half.e, wanted);
    const width = second - first;
    g.font = font(11);
    g.lineWidth = 1;
    const text = (v) => (Math.abs(v) >= 1e4 && width >= 1000 ? signed(v / 1000) + " km" : signed(Number(v.toFixed(3))));
    for (let k = Math.ceil((s.e - half.e) / width); k * width <= s.e + half.e; k++) {
      const x = Math.round(xy(k * width, 0)[0]) + 0.5;
      g.strokeStyle = k ? colour.grid : colour.line;
      g.beginPath(); g.moveTo(x, b.y); g.lineTo(x, b.y + b.h); g.stroke();
      g.fillStyle = colour.soft;
      g.textAlign = "center"; g.textBaseline = "top";
      if (x < b.x + b.w - 34) g.fillText(text(k * width), x, b.y + b.h + 5);
    }
    for (let k = Math.ceil((s.n - half.n) / width); k * width <= s.n + half.n; k++) {
      const y = Math.round(xy(0, k * width)[1]) + 0.5;
      g.strokeStyle = k ? colour.grid : colour.line;
      g.beginPath(); g.moveTo(b.x, y); g.lineTo(b.x + b.w, y); g.stroke();
      g.fillStyle = colour.soft;
      g.textAlign = "right"; g.textBaseline = "middle";
      if (y > b.y + 18) g.fillText(text(k * width), b.x - 7, Math.min(y, b.y + b.h - 4));
    }
    g.textAlign = "right"; g.textBaseline = "top";
    g.fillText("east", b.x + b.w, b.y + b.h + 5);
    g.fillText("north", b.x - 7, b.y);
    return width;
  }
  function scaleBar(g, width) {
    const b = p.box, px = width / now().scale, x = b.x + b.w - 14 - px, y = b.y + b.h - 14;
    const text = width >= 1000 ? width / 1000 + " km" : Number(width.toPrecision(3)) + " m";
    g.fillStyle = colour.paper;
    g.globalAlpha = 0.8;
    g.fillRect(x - 6, y - 18, px + 12, 26);
    g.globalAlpha = 1;
    g.strokeStyle = g.fillStyle = colour.ink;
    g.lineWidth = 1.5;
    g.beginPath(); g.moveTo(x, y - 4); g.lineTo(x, y); g.lineTo(x + px, y); g.lineTo(x + px, y - 4); g.stroke();
    g.font = font(11);
    g.textAlign = "center"; g.textBaseline = "bottom";
    g.fillText(text, x + px / 2, y - 3);
  }

  p.draw = () => {
    const g = prepare(p), b = p.box;
    const byState = (i) => D.states[col.state[i]];
    const clip = (g) => { g.save(); g.beginPath(); g.rect(b.x, b.y, b.w, b.h); g.clip(); };
    keptPicture(p, g, Object.values(now()), (g) => {
      const width = grid(g);
      clip(g);
      g.lineJoin = "round";
      const [from, to] = visible();
      const all = view[0] === whole[0] && view[1] === whole[1];
      if (isCloud) {
        if (!all) { g.globalAlpha = 0.3; dots(g, 0, N, () => "faint"); g.globalAlpha = 1; }
        dots(g, from, to, byState);
      } else {
        if (!all) { g.lineWidth = 1; line(g, track.e, track.n, 0, N, () => "faint"); }
        g.lineWidth = 2.5;
        line(g, track.e, track.n, from, to, byState);
      }
      const first = isCloud ? track.te.findIndex((v) => v === v) : -1;
      if (first >= 0) {
        const [x, y] = xy(track.te[first], track.tn[first]);
        g.strokeStyle = colour.ink;
        g.lineWidth = 1.5;
        g.beginPath(); g.moveTo(x - 8, y); g.lineTo(x + 8, y); g.moveTo(x, y - 8); g.lineTo(x, y + 8); g.stroke();
      } else if (D.truth) {
        g.lineWidth = 1;
        g.setLineDash([4, 3]);
        line(g, track.te, track.tn, from, to, () => "ink");
        g.setLineDash([]);
      }
      scaleBar(g, width);
      g.restore();
    });
    if (cursor !== null && track.e[cursor] === track.e[cursor]) {
      const [x, y] = xy(track.e[cursor], track.n[cursor]), r = col.hpl[cursor] / now().scale;
      clip(g);
      g.strokeStyle = colour.level;
      g.lineWidth = 1.5;
      if (r === r) { g.beginPath(); g.arc(x, y, r, 0, 7); g.stroke(); }
      g.fillStyle = colour[byState(cursor)];
      g.strokeStyle = colour.ink;
      g.beginPath(); g.arc(x, y, 4.5, 0, 7); g.fill(); g.stroke();
      g.restore();
    }
    frame(g, p);
  };
  p.read = (i) => {
    value.textContent = i === null || !(track.e[i] === track.e[i]) ? "" : "E " + signed(track.e[i], 2) + " N " + signed(track.n[i], 2) + " h " + signed(track.h[i], 2) + " m";
  };
  // The epoch nearest to a place, among those in view.
  p.nearest = (x, y) => {
    const [from, to] = visible();
    let best = null, near = 24 * 24;
    for (let i = from; i < to; i++) {
      if (!(track.e[i] === track.e[i])) continue;
      const [px, py] = xy(track.e[i], track.n[i]), d = (px - x) * (px - x) + (py - y) * (py - y);
      if (d < near) { near = d; best = i; }
    }
    return best;
  };
  p.zoom = (factor, x, y) => {
    const s = now(), b = p.box, scale = Math.min(Math.max(s.scale / factor, 1e-4), 1e5), change = s.scale - scale;
    sight = { e: s.e + (x - b.x - b.w / 2) * change, n: s.n - (y - b.y - b.h / 2) * change, scale };
    redraw();
  };
  p.pan = (dx, dy) => {
    const s = now();
    sight = { e: s.e - dx * s.scale, n: s.n + dy * s.scale, scale: s.scale };
    redraw();
  };
  p.reset = () => { sight = null; redraw(); };
  panels.push(p);
}
