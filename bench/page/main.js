// From compressed library to drawn page.

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(byId(id).textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

function drawHead() {
  const m = DATA.machine, packages = Object.entries(m.packages).map(([name, number]) => `${name} ${number}`).join(", ");
  byId("machine").textContent = `${m.renderer} (OpenGL ${m.opengl}) · ${m.cpu}, ${m.threads} threads · ${m.system} · Python ${m.python}, ${packages} · ` +
    `presets ${DATA.preset.svgf} (SVGF) and ${DATA.preset.bmfr} (BMFR) unless said otherwise, seed ${DATA.seed} · ${m.date.slice(0, 16).replace("T", " ")} · measured in ${(DATA.seconds / 60).toFixed(1)} min`;
  byId("notes").replaceChildren(...DATA.notes.map((note) => make("p", { class: "note" }, note)));
  byId("map-top").textContent = `${DATA.mapTop} FLIP and more`;
  byId("metric-choice").replaceChildren(...Object.entries(METRICS).map(([name, metric]) => make("option", { value: name }, metric.label)));
  byId("metric-choice").onchange = (event) => { state.metric = event.target.value; changed(); };
  byId("stage-choice").onchange = (event) => { state.stages = event.target.checked; changed(); };
}

function chooseScene(index) {
  state.scene = index;
  choices(byId("scene-choice"), DATA.scenes.map((s) => s.name), index, chooseScene);
  viewer.begin();
  if (window.Plotly) drawPasses();
  changed();
}

async function start() {
  drawHead();
  drawRest();
  viewer.start();
  state.listeners = [drawTable, drawClaims];
  if (DATA.scenes.length) chooseScene(0);
  try {
    const script = document.createElement("script");
    script.textContent = await unpacked("library");
    document.head.append(script);
  } catch (error) {
    byId("scatter").replaceChildren(make("p", { class: "failed" }, `This browser cannot unpack the diagrams (${error}); tables and pictures work.`));
    return;
  }
  state.listeners = [drawScatter, drawFrames, drawTable, drawClaims, drawEvents];
  if (DATA.scenes.length) { drawPasses(); changed(); }
  document.body.dataset.ready = "1";
}

let resizing = 0;
window.addEventListener("resize", () => {
  clearTimeout(resizing);
  resizing = setTimeout(() => { if (document.body.dataset.ready) { changed(); drawPasses(); } }, 200);
});
start();
