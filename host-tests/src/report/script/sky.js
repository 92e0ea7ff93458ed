// ---- the sky: where the satellites stood, and which were excluded ------------------------------
function skyPanel(parent) {
  const p = makeFigure(parent, "Sky plot", "azimuth and elevation");
  p.canvas.setAttribute("aria-label", "sky plot: azimuth and elevation of the satellites");
  p.figure.className = "still";
  p.height = 440;
  p.own = true;
  systemKeys(p.caption);
  if (skies.sats.some((s) => s.out.length)) addKey(p.caption, "excluded, from – to", "alert", "");
  addKey(p.caption, "not in the position", "faint", "");
  const hint = document.createElement("span");
  hint.className = "key line";
  hint.textContent = "symbols: where they stand at the cursor, else at the end of what is shown";
  p.caption.append(hint);
  const readout = document.createElement("span");
  readout.className = "key";
  const value = document.createElement("b");
  readout.append(value);
  p.caption.append(readout);
  const used = new Map(D.sats.map((s) => [s.id, s.used]));
  let centre = null, pointed = null, placed = [], labels = [];

  const place = (s, k) => {
    const r = (90 - Math.max(0, s.el[k])) / 90 * centre.r, a = s.az[k] * Math.PI / 180;
    return [centre.x + r * Math.sin(a), centre.y - r * Math.cos(a)];
  };
  function path(g, s, from, to, only) {
    let open = false, before = NaN;
    g.beginPath();
    for (let k = from; k < to; k++) {
      const there = s.az[k] === s.az[k] && only(k);
      if (!there) { open = false; continue; }
      const [x, y] = place(s, k);
      if (open && skies.time[k] - before <= skies.gap) g.lineTo(x, y); else { g.moveTo(x, y); g.lineTo(x + 0.1, y); }
      open = true;
      before = skies.time[k];
    }
    g.stroke();
  }
  // Circle, square, triangle: a system is known without its colour.
  function symbol(g, s, x, y, size) {
    g.beginPath();
    if (s.id[0] === "E") g.rect(x - size, y - size, 2 * size, 2 * size);
    else if (s.id[0] === "C") { g.moveTo(x, y - 1.2 * size); g.lineTo(x + 1.1 * size, y + 0.8 * size); g.lineTo(x - 1.1 * size, y + 0.8 * size); g.closePath(); }
    else g.arc(x, y, size, 0, 7);
  }
  function halo(g, text, x, y, css) {
    g.lineWidth = 3;
    g.strokeStyle = colour.paper;
    g.strokeText(text, x, y);
    g.fillStyle = colour[css];
    g.fillText(text, x, y);
  }

  p.draw = () => {
    const g = prepare(p);
    const width = p.canvas.clientWidth;
    centre = { x: width / 2, y: p.height / 2, r: Math.max(20, Math.min(width / 2 - 26, p.height / 2 - 20)) };
    const from = Math.max(0, Math.floor(lower(view[0]) / skies.each)), to = Math.min(skies.B, skyBin(Math.min(N - 1, lower(view[1]))) + 1);
    const usedIn = (s, k) => (used.get(s.id) || []).some(([a, b]) => a < (k + 1) * skies.each && b > k * skies.each);
    keptPicture(p, g, [pointed && pointed.id], (g) => {
      labels = [];
      g.font = font(11);
      g.lineWidth = 1;
      for (const el of [0, 30, 60]) {
        g.strokeStyle = el ? colour.grid : colour.line;
        g.beginPath(); g.arc(centre.x, centre.y, (90 - el) / 90 * centre.r, 0, 7); g.stroke();
      }
      for (let a = 0; a < 180; a += 30) {
        const [dx, dy] = [Math.sin(a * Math.PI / 180) * centre.r, Math.cos(a * Math.PI / 180) * centre.r];
        g.strokeStyle = colour.grid;
        g.beginPath(); g.moveTo(centre.x - dx, centre.y + dy); g.lineTo(centre.x + dx, centre.y - dy); g.stroke();
      }
      g.lineJoin = "round";
      for (const s of skies.sats) {
        g.strokeStyle = colour.faint;
        g.lineWidth = 0.75;
        path(g, s, from, to, () => true);
        g.strokeStyle = colour[s.css];
        g.lineWidth = s === pointed ? 3 : 1.5;
        const within = new Uint8Array(skies.B);
        for (const [a, b] of used.get(s.id) || []) within.fill(1, Math.floor(a / skies.each), Math.ceil(b / skies.each));
        path(g, s, from, to, (k) => within[k]);
      }
      for (const s of skies.sats) for (const [a, b] of s.out) {
        const known = labels.find((label) => label.s === s);
        const first = Math.max(from, Math.floor(a / skies.each)), end = Math.min(to, Math.ceil(b / skies.each));
        if (first >= end) continue;
        g.strokeStyle = colour.alert;
        g.lineWidth = 4;
        path(g, s, first, end, () => true);
        if (known) { known.more++; continue; }
        let k = first;
        while (k < end && !(s.az[k] === s.az[k])) k++;
        if (k < end) labels.push({ s, at: place(s, k), text: clock(T[a], 0) + " – " + clock(T[b - 1], 0), more: 0 });
      }
    });
    // Where they stand now.
    const at = cursor === null ? Math.min(N - 1, Math.max(0, lower(view[1] + 1e-6) - 1)) : cursor;
    const k = skyBin(at);
    placed = [];
    g.font = font(10);
    g.textAlign = "left";
    g.textBaseline = "middle";
    for (const s of skies.sats) {
      if (!(s.az[k] === s.az[k])) continue;
      const [x, y] = place(s, k), out = isOut(s, at);
      symbol(g, s, x, y, s === pointed ? 5.5 : 4);
      g.fillStyle = out ? colour.alert : usedIn(s, k) ? colour[s.css] : colour.paper;
      g.strokeStyle = out ? colour.alert : usedIn(s, k) ? colour.paper : colour.faint;
      g.lineWidth = 1;
      g.fill(); g.stroke();
      if (out) { g.lineWidth = 2; g.beginPath(); g.arc(x, y, 9, 0, 7); g.stroke(); }
      halo(g, s.id, x + 8, y, out ? "alert" : "ink");
      placed.push([s, x, y]);
    }
    g.font = "600 " + font(11);
    for (const { s, at: [x, y], text, more } of labels) {
      const right = x < centre.x;
      g.textAlign = right ? "left" : "right";
      halo(g, s.id + " out " + text + (more ? " and " + more + " more" : ""), right ? x + 8 : x - 8, y + 15, "alert");
    }
    g.font = font(11);
    g.textAlign = "center";
    g.fillStyle = colour.soft;
    for (const [text, a] of [["N", 0], ["E", 90], ["S", 180], ["W", 270]]) {
      g.textBaseline = "middle";
      halo(g, text, centre.x + Math.sin(a * Math.PI / 180) * (centre.r + 11), centre.y - Math.cos(a * Math.PI / 180) * (centre.r + 11), "soft");
    }
    for (const el of [30, 60]) halo(g, el + "°", centre.x + 2, centre.y - (90 - el) / 90 * centre.r, "soft");
  };
  p.read = (i) => {
    if (!pointed) { value.textContent = ""; return; }
    const k = skyBin(i === null ? Math.min(N - 1, Math.max(0, lower(view[1] + 1e-6) - 1)) : i), s = pointed;
    const parts = [s.id];
    if (s.az[k] === s.az[k]) parts.push("azimuth " + s.az[k].toFixed(1) + "°", "elevation " + s.el[k].toFixed(1) + "°");
    if (s.residual[0][k] === s.residual[0][k]) parts.push("residual " + signed(s.residual[1][k], 2) + "\u2009m");
    if (s.cn0[0][k] === s.cn0[0][k]) parts.push(s.cn0[1][k].toFixed(1) + "\u2009dB-Hz");
    value.textContent = parts.join("\u2002");
  };
  p.pointAt = (x, y) => {
    const before = pointed;
    pointed = null;
    let near = 16 * 16;
    for (const [s, px, py] of placed) {
      const d = (px - x) * (px - x) + (py - y) * (py - y);
      if (d < near) { near = d; pointed = s; }
    }
    if (before !== pointed) { p.read(cursor); redraw(); }
  };
  panels.push(p);
}
