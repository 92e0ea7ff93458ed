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
  stateRows.push({ label: letter, rule: !reasonNames.length, layers: stateOrder.map((s) => ({ css: s, ranges: rangesWhere((i) => col.reason[i] === k && D.states[col.state[i]] === s), inset: 3 })) });
  reasonNames.push(letter + "\u2002" + words(r));
});
const reasonAt = (i) => { const r = D.reasons[col.reason[i]]; return r === "none" || r === "" ? "" : words(r); };
stripPanel(main, {
  name: "Integrity by state and reason", rowHeight: 15, rows: stateRows, legend: reasonNames,
  read: (i) => D.states[col.state[i]] + (reasonAt(i) ? ": " + reasonAt(i) : ""),
});

// Where it was, and under which sky.
if (track || skies) {
  const pair = document.createElement("div");
  pair.className = "pair wide";
  main.append(pair);
  if (track) trackPanel(pair);
  if (skies) skyPanel(pair);
}
if (track) {
  linePanel(main, {
    name: "Height above the ellipsoid", unit: "m", signed: true, height: 130,
    lines: [
      { name: "truth", values: track.th, css: "ink", dash: [4, 3], width: 1 },
      { name: "position", values: track.h, css: "level", width: 1.5 },
    ],
  });
}

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
  name: "Horizontal level and error", unit: "m", log: true, note: D.truth ? "" : "no truth given",
  lines: [
    { name: "alert limit", values: col.hal, css: "limit", dash: [6, 4], limit: true, width: 1 },
    { name: "HPL", values: col.hpl, css: "level", width: 1.5 },
    { name: "uncertainty at alert", values: col.uh, css: "second", width: 1.5 },
    { name: "error", values: col.he, css: "error", width: 1 },
  ],
});
linePanel(main, {
  name: "Vertical level and error", unit: "m", log: true, note: D.truth ? "" : "no truth given",
  lines: [
    { name: "alert limit", values: col.val, css: "limit", dash: [6, 4], limit: true, width: 1 },
    { name: "VPL", values: col.vpl, css: "level", width: 1.5 },
    { name: "uncertainty at alert", values: col.uv, css: "second", width: 1.5 },
    { name: "error", values: col.ve, css: "error", width: 1 },
  ],
});
if (skies) {
  satellitePanel(main, { name: "Residuals by satellite", unit: "m", get: (s) => s.residual, scale: residualScale });
  satellitePanel(main, { name: "C/N0 by satellite", unit: "dB-Hz", get: (s) => s.cn0, scale: cn0Scale });
}
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

