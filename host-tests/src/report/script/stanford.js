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

