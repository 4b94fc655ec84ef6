// The diagrams, by Plotly.

const FONT = { family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 13, color: "#1d2129" };
const CONFIG = { displaylogo: false, responsive: true, displayModeBar: window.innerWidth < 640 ? false : "hover", modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
const AXIS = { automargin: true, gridcolor: "#e6e9ed", linecolor: "#b9c0ca", zeroline: false, ticks: "outside", tickcolor: "#b9c0ca", ticklen: 4 };
const narrow = () => window.innerWidth < 640;

function layout(more) {
  return {
    font: FONT, paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "closest",
    margin: narrow() ? { l: 60, r: 8, t: 8, b: 48 } : { l: 72, r: 16, t: 10, b: 52 }, modebar: { orientation: "v", bgcolor: "transparent" },
    hoverlabel: { bgcolor: "#fff", bordercolor: "#b9c0ca", font: { ...FONT, size: 12 }, align: "left" },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 12 } }, ...more,
  };
}

// Plain numbers on a logarithmic axis: 1, 2 and 5 of every decade, or all digits where there are few decades.
function ticks(values) {
  const low = Math.min(...values), high = Math.max(...values), found = [];
  const steps = high / low > 30 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 7];
  for (let decade = Math.floor(Math.log10(low)); decade <= Math.ceil(Math.log10(high)); ++decade)
    for (const step of steps) {
      const value = step * Math.pow(10, decade);
      if (value >= low * 0.7 && value <= high * 1.4) found.push(value);
    }
  return { tickvals: found, ticktext: found.map((v) => String(Number(v.toPrecision(2)))) };
}

function described(m) {
  const e = m.errors, lines = [
    `<b>${escaped(m.name)}</b>`,
    `${time(m.ms)} ms a frame` + (m.group === "path tracing" ? "" : ` (tracing ${time(m.ms - m.filter)}, filter ${time(m.filter)}, p95 ${time(m.p95)})`),
    `RMSE ${fixed(e.rmse, 4)} · relMSE ${fixed(e.relmse, 4)} · temporal ${fixed(e.temporal, 4)}`,
    `FLIP ${fixed(e.flip, 4)} · SSIM ${fixed(e.ssim, 4)} · PSNR ${fixed(e.psnr, 2)} dB`,
  ];
  if (m.equal) lines.push(`in that time ${m.equal.samples} path${m.equal.samples > 1 ? "s" : ""} per pixel: RMSE ${fixed(m.equal.rmse, 4)}, FLIP ${fixed(m.equal.flip, 4)}`);
  const words = m.settings.split(" "), rows = [""];
  for (const word of words) {
    if ((rows[rows.length - 1] + word).length > 52) rows.push("");
    rows[rows.length - 1] += (rows[rows.length - 1] ? " " : "") + word;
  }
  return lines.concat(rows.map((row) => `<span style="color:#5d6675">${escaped(row)}</span>`)).join("<br>");
}

// What nothing drawn beats in both; steps, because between two settings there is nothing.
function paretoFront(points) {
  const sorted = [...points].sort((a, b) => a.x - b.x || a.y - b.y), front = [];
  for (const point of sorted) if (!front.length || point.y < front[front.length - 1].y) front.push(point);
  return front;
}

function drawScatter() {
  const metric = state.metric, place = byId("scatter");
  const methods = visible(scene().methods).filter((m) => m.competes && drawn(metric, m.errors[metric]) > 0);
  const traces = [], groups = [...new Set(methods.map((m) => m.group))];
  const x = (m) => m.ms, y = (m) => drawn(metric, m.errors[metric]);
  const competing = scene().methods.filter((m) => m.competes && y(m) > 0).map((m) => ({ x: x(m), y: y(m) }));
  const front = paretoFront(competing);
  traces.push({
    x: front.map((p) => p.x), y: front.map((p) => p.y), mode: "lines", name: "Pareto front", hoverinfo: "skip",
    line: { shape: "hv", color: "#1a7f4b", width: 1.5, dash: "dot" },
  });
  for (const group of groups) {
    const members = methods.filter((m) => m.group === group), traced = group === "path tracing";
    traces.push({
      x: members.map(x), y: members.map(y), customdata: members.map((m) => m.name), text: members.map(described),
      name: group, hovertemplate: "%{text}<extra></extra>", mode: traced ? "lines+markers" : "markers",
      line: { color: color(group), width: 1 },
      marker: {
        color: members.map((m) => (m.stage ? "#fff" : color(group))), size: members.map((m) => (m.stage ? 8 : traced ? 6 : 12)),
        line: { color: color(group), width: members.map((m) => (m.stage ? 1.6 : 1)) }, opacity: 0.95, symbol: group === "OIDN" ? "diamond" : "circle",
      },
    });
  }
  const shapes = [], annotations = [], floors = scene().floors;
  if (floors && drawn(metric, floors[metric]) > 0) {
    const floor = drawn(metric, floors[metric]);
    shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, y0: floor, y1: floor, line: { color: "#b3372c", width: 1, dash: "dash" } });
    annotations.push({ xref: "paper", x: 1, xanchor: "right", y: Math.log10(floor), yanchor: "bottom", showarrow: false, text: "noise of the reference", font: { size: 11, color: "#b3372c" } });
  }
  const ranges = [methods.map(x), methods.map(y).concat(floors ? [drawn(metric, floors[metric])] : [])].map((values) => {
    const logs = values.filter((v) => v > 0).map(Math.log10), low = Math.min(...logs), high = Math.max(...logs), pad = 0.06 * (high - low) + 0.02;
    return [low - pad, high + pad];
  });
  if (!narrow()) annotations.push(...labels(methods, x, y, ranges, place));
  for (const m of methods.filter((m) => m.group === "path tracing"))
    annotations.push({ x: Math.log10(x(m)), y: Math.log10(y(m)), text: m.name.replace(" paths", ""), showarrow: false, yanchor: "bottom", yshift: 5, font: { size: 10, color: "#555" } });
  const floorValue = floors && drawn(metric, floors[metric]) > 0 ? [drawn(metric, floors[metric])] : [];
  Plotly.react(place, traces, layout({
    xaxis: { ...AXIS, type: "log", range: ranges[0], title: { text: "ms a frame: tracing + filter" }, ...ticks(methods.map(x)) },
    yaxis: { ...AXIS, type: "log", range: ranges[1], title: { text: narrow() ? METRICS[metric].label : METRICS[metric].title, standoff: 10 }, ...ticks(methods.map(y).concat(floorValue)) },
    shapes, annotations,
  }), CONFIG);
  if (!place.dataset.wired) {
    place.dataset.wired = "1";
    place.on("plotly_click", (event) => { const name = event.points[0].customdata; if (name) viewer.show(name); });
  }
  const s = scene();
  byId("scatter-say").textContent = `${s.name}, ${s.motion}, ${s.size[0]}×${s.size[1]}, against ${s.samples.toLocaleString("en")} paths per pixel. ` +
    `Tracing one path per pixel takes ${time(s.trace)} ms, each further path ${time(s.sample)} ms.`;
}

// Names beside their marks, where they hide neither another name nor a mark; the rest is told by pointing at them.
function labels(methods, x, y, ranges, place) {
  const wide = place.clientWidth - 88, tall = place.clientHeight - 100;
  const px = (m) => (Math.log10(x(m)) - ranges[0][0]) / (ranges[0][1] - ranges[0][0]) * wide;
  const py = (m) => (Math.log10(y(m)) - ranges[1][0]) / (ranges[1][1] - ranges[1][0]) * tall;
  const taken = methods.map((m) => [px(m) - 6, py(m) - 6, px(m) + 6, py(m) + 6]), found = [];
  const free = (b) => b[0] > 0 && b[2] < wide && taken.every((o) => b[2] < o[0] || b[0] > o[2] || b[3] < o[1] || b[1] > o[3]);
  for (const m of methods.filter((one) => !one.stage && one.group !== "path tracing")) {
    const w = 6.1 * m.name.length, cx = px(m), cy = py(m);
    const spots = [["left", "middle", 9, 0, cx + 9, cy - 7], ["right", "middle", -9, 0, cx - 9 - w, cy - 7], ["center", "bottom", 0, 8, cx - w / 2, cy + 8], ["center", "top", 0, -8, cx - w / 2, cy - 22]];
    const spot = spots.find(([, , , , left, low]) => free([left, low, left + w, low + 14]));
    if (!spot) continue;
    taken.push([spot[4], spot[5], spot[4] + w, spot[5] + 14]);
    found.push({ x: Math.log10(x(m)), y: Math.log10(y(m)), text: escaped(m.name), showarrow: false, xanchor: spot[0], yanchor: spot[1], xshift: spot[2], yshift: spot[3], font: { size: 11, color: color(m.group) } });
  }
  return found;
}

// The four pairs of consecutive frames that have a reference.
function drawFrames() {
  const metric = state.metric === "flip" ? "flip" : "rmse";
  const shown = viewer.slots().filter((name) => name !== viewer.REFERENCE);
  const traces = shown.map((name) => {
    const m = scene().methods.find((one) => one.name === name);
    return {
      x: m.frames.map((f) => f.frame), y: m.frames.map((f) => f[metric]), name: m.name, mode: "lines+markers",
      line: { color: color(m.group), width: 1.6, dash: DASHES[shown.filter((n) => scene().methods.find((o) => o.name === n).group === m.group).indexOf(name) % DASHES.length] },
      marker: { size: 5 }, hovertemplate: `${escaped(m.name)}<br>frame %{x}: %{y:.4f}<extra></extra>`,
    };
  });
  const all = traces.flatMap((t) => t.y).filter((v) => v > 0);
  Plotly.react("frames", traces, layout({
    showlegend: !narrow(), legend: { font: { size: 11 }, x: 1.01, y: 1 },
    xaxis: { ...AXIS, title: { text: "frame" }, dtick: 2 },
    yaxis: { ...AXIS, type: "log", title: { text: METRICS[metric].label, standoff: 10 }, ...ticks(all) },
  }), CONFIG);
}
const DASHES = ["solid", "dash", "dot", "dashdot"];

// Passes in kinds, so that methods can be compared part by part.
const KINDS = [
  ["upload", /^upload$/, "#9aa3b0"], ["reprojection and accumulation", /reproject|accumulate|resolve|combine|blend/, "#4c86d8"],
  ["variance or gradient", /variance|moment|gradient|strat/, "#7d5fb8"], ["wavelet or kernel", /atrous|gauss|bilateral|guided|box|blur|filter/, "#1f9e89"],
  ["regression", /fit|solve|block/, "#d9730d"], ["network", /oidn/, "#2e9e4f"], ["anti-aliasing", /^taa/, "#c2477f"],
  ["modulation and display", /modulate|tonemap|encode|exposure|display|mark/, "#c9b458"], ["other", /./, "#c4c9d1"],
];
const kindOf = (pass) => KINDS.findIndex((kind) => kind[1].test(pass));

function drawPasses() {
  const methods = scene().methods.filter((m) => m.passes.length && !m.stage).sort((a, b) => b.filter - a.filter);
  const traces = KINDS.map(([name, , shade], index) => {
    const parts = methods.map((m) => m.passes.filter((p) => kindOf(p[0]) === index));
    return {
      type: "bar", orientation: "h", name, marker: { color: shade }, y: methods.map((m) => m.name),
      x: parts.map((passes) => passes.reduce((sum, p) => sum + p[1], 0)),
      text: parts.map((passes) => passes.map((p) => `${escaped(p[0])} ${time(p[1])} ms`).join("<br>")), textposition: "none",
      hovertemplate: `<b>%{y}</b>, ${name}: %{x:.2f} ms<br>%{text}<extra></extra>`,
    };
  }).filter((trace) => trace.x.some((v) => v > 0));
  const place = byId("passes");
  place.style.height = `${(narrow() ? 190 : 120) + 27 * methods.length}px`;
  Plotly.react(place, traces, layout({
    barmode: "stack", bargap: 0.28, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 12 }, traceorder: "normal" }, margin: { l: narrow() ? 150 : 205, r: 12, t: 8, b: 46 },
    xaxis: { ...AXIS, title: { text: "ms" } }, yaxis: { automargin: false, tickfont: { size: narrow() ? 10 : 12 } },
  }), CONFIG);
}

let eventShown = 0;
function drawEvents() {
  const events = DATA.events;
  byId("events-section").hidden = !events;
  if (!events) return;
  const names = Object.keys(events.noise), name = names[eventShown];
  choices(byId("event-choice"), names, eventShown, (index) => { eventShown = index; drawEvents(); });
  const methods = visible(events.methods).filter((m) => !m.stage);
  const traces = methods.map((m) => ({
    x: m.errors[name].map((_, index) => index), y: m.errors[name], name: m.name, mode: "lines",
    line: { color: color(m.group), width: 1.7, dash: DASHES[methods.filter((o) => o.group === m.group).indexOf(m) % DASHES.length] },
    hovertemplate: `${escaped(m.name)}<br>%{x} frames after: %{y:.4f}<extra></extra>`,
  }));
  const all = methods.flatMap((m) => m.errors[name]).filter((v) => v > 0);
  Plotly.react("events", traces, layout({
    showlegend: !narrow(), legend: { font: { size: 11 }, x: 1.01, y: 1 },
    xaxis: { ...AXIS, title: { text: `frames after: ${name}` } },
    yaxis: { ...AXIS, type: "log", title: { text: "RMSE", standoff: 10 }, ...ticks(all) },
  }), CONFIG);
  byId("events-say").textContent = `${events.scene}, ${events.size[0]}×${events.size[1]}, ${events.samples.toLocaleString("en")} paths per pixel in the references. ` +
    "The camera rests but for the event. After a disocclusion only what it uncovers counts.";
  drawEventsTable(events, names);
}
