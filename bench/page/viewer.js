// Pictures to flip between: one view, the same for all, so that nothing moves but what differs.

const viewer = (() => {
  const REFERENCE = "reference", MOST = 10;
  // What gets a number key where there are more methods than keys; the lists have them all.
  const PREFERRED = ["noisy", "accumulation", "SVGF, one signal", "SVGF, direct and indirect", "A-SVGF", "BMFR", "guided filter", "OIDN, fast"];
  const images = new Map();               // data URI -> Image
  const pane = { a: REFERENCE, b: REFERENCE };
  let view = { x: 0.5, y: 0.5, zoom: 1 }; // centre in parts of the picture, magnification against the fitted picture
  let two = false, map = false, hovered = "a";
  const magma = makeMagma();

  // The number keys' pictures: the reference, then methods in order, those without variants first.
  function slots() {
    const shown = scene().methods.filter((m) => m.pictures && !m.stage);
    const traced = shown.filter((m) => m.group === "path tracing"), others = shown.filter((m) => m.group !== "path tracing");
    // Of path tracing, what fits into the time of the slowest of our filters.
    const slowest = Math.max(...others.filter((m) => m.group !== "OIDN").map((m) => m.ms));
    const best = traced.filter((m) => m.ms <= slowest).slice(-1);
    const first = PREFERRED.map((name) => others.find((m) => m.name === name)).filter(Boolean);
    const rest = others.filter((m) => !first.includes(m));
    const chosen = [...first, ...rest].slice(0, MOST - 1 - best.length);
    const order = [...others.filter((m) => chosen.includes(m)), ...best];
    return [REFERENCE, ...order.map((m) => m.name)];
  }
  const all = () => [REFERENCE, ...scene().methods.filter((m) => m.pictures).map((m) => m.name)];
  const picturesOf = (name) => (name === REFERENCE ? scene().truth : (scene().methods.find((m) => m.name === name) || {}).pictures);

  function image(uri) {
    if (!uri) return null;
    if (!images.has(uri)) {
      const loaded = new Image();
      loaded.onload = draw;
      loaded.src = uri;
      images.set(uri, loaded);
    }
    const found = images.get(uri);
    return found.complete && found.naturalWidth ? found : null;
  }

  const colored = new Map();
  function errorMap(uri) {
    const source = image(uri);
    if (!source) return null;
    if (!colored.has(uri)) {
      const canvas = make("canvas", { width: source.naturalWidth, height: source.naturalHeight });
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(source, 0, 0);
      const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
      for (let i = 0; i < pixels.data.length; i += 4) pixels.data.set(magma[pixels.data[i]], i);
      context.putImageData(pixels, 0, 0);
      colored.set(uri, canvas);
    }
    return colored.get(uri);
  }

  function drawPane(which) {
    const canvas = byId(`canvas-${which}`), [width, height] = scene().size, ratio = window.devicePixelRatio || 1;
    const wide = canvas.clientWidth;
    if (!wide) return;
    const tall = Math.round(wide * height / width);
    canvas.style.height = `${tall}px`;
    canvas.width = Math.round(wide * ratio);
    canvas.height = Math.round(tall * ratio);
    const context = canvas.getContext("2d"), pictures = picturesOf(pane[which]);
    const source = pictures && (map ? errorMap(pictures.flip) : image(pictures.picture));
    const scale = canvas.width / width * view.zoom;
    context.imageSmoothingEnabled = scale < 1.5;
    context.fillStyle = "#0c0d10";
    context.fillRect(0, 0, canvas.width, canvas.height);
    if (source) context.drawImage(source, canvas.width / 2 - view.x * width * scale, canvas.height / 2 - view.y * height * scale, width * scale, height * scale);
    else if (map && pictures) {
      context.fillStyle = "#98a1b0";
      context.font = `${14 * ratio}px sans-serif`;
      context.fillText("the reference is what errors are measured against", 14 * ratio, 26 * ratio);
    }
    const m = scene().methods.find((one) => one.name === pane[which]);
    const numbers = m ? `RMSE ${fixed(m.errors.rmse, 4)} · FLIP ${fixed(m.errors.flip, 4)} · ${time(m.ms)} ms` : `${scene().samples.toLocaleString("en")} paths per pixel`;
    byId(`caption-${which}`).replaceChildren(make("span", {}, pane[which] + (map ? ": FLIP error map" : "")), make("span", {}, numbers));
  }

  function draw() {
    byId("panes").classList.toggle("one", !two);
    byId("pick-b-label").hidden = !two;
    byId("two-button").setAttribute("aria-pressed", String(two));
    byId("map-button").setAttribute("aria-pressed", String(map));
    byId("map-scale").hidden = !map;
    byId("zoom-text").textContent = `${view.zoom < 10 ? view.zoom.toFixed(1).replace(/\.0$/, "") : view.zoom.toFixed(0)}×`;
    drawPane("a");
    if (two) drawPane("b");
    const names = slots();
    byId("slots").replaceChildren(...names.map((name, index) => make("button", {
      type: "button", "aria-pressed": String(name === pane.a), onclick: () => show(name),
    }, make("kbd", {}, String(index)), name)));
    for (const which of ["a", "b"]) byId(`pick-${which}`).value = pane[which];
  }

  function show(name, which = "a") {
    if (!picturesOf(name)) return;
    pane[which] = name;
    draw();
  }

  function clampView() {
    view.zoom = Math.min(64, Math.max(1, view.zoom));
    const half = 0.5 / view.zoom;
    view.x = Math.min(1 - half, Math.max(half, view.x));
    view.y = Math.min(1 - half, Math.max(half, view.y));
  }

  // Magnify by a factor; what is under (px, py), in parts of the canvas, stays where it is.
  function zoomBy(factor, px = 0.5, py = 0.5) {
    const before = view.zoom;
    view.zoom = Math.min(64, Math.max(1, before * factor));
    view.x += (px - 0.5) * (1 / before - 1 / view.zoom);
    view.y += (py - 0.5) * (1 / before - 1 / view.zoom);
    clampView();
    draw();
  }

  function wire(which) {
    const canvas = byId(`canvas-${which}`), pointers = new Map();
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    };
    canvas.addEventListener("pointerenter", () => { hovered = which; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoomBy(Math.pow(1.0015, -event.deltaY), ...place(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.classList.add("held");
      pointers.set(event.pointerId, place(event));
      byId("panes").focus({ preventScroll: true });
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return;
      const [oldX, oldY] = pointers.get(event.pointerId), now = place(event);
      const others = [...pointers].filter(([id]) => id !== event.pointerId);
      if (others.length) {
        const [ox, oy] = others[0][1], spread = (x, y) => Math.max(0.02, Math.hypot(x - ox, y - oy));
        pointers.set(event.pointerId, now);
        zoomBy(spread(...now) / spread(oldX, oldY), (now[0] + ox) / 2, (now[1] + oy) / 2);
      } else {
        view.x -= (now[0] - oldX) / view.zoom;
        view.y -= (now[1] - oldY) / view.zoom;
        pointers.set(event.pointerId, now);
        clampView();
        draw();
      }
    });
    for (const end of ["pointerup", "pointercancel"])
      canvas.addEventListener(end, (event) => { pointers.delete(event.pointerId); if (!pointers.size) canvas.classList.remove("held"); });
    canvas.addEventListener("dblclick", fit);
  }

  function fit() { view = { x: 0.5, y: 0.5, zoom: 1 }; draw(); }
  const toggleMap = () => { map = !map; draw(); };
  const toggleTwo = () => { two = !two; if (!two) hovered = "a"; draw(); };

  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    if (/^[0-9]$/.test(event.key)) {
      const name = slots()[Number(event.key)];
      if (name) show(name, two ? hovered : "a");
    } else if (event.key.toLowerCase() === "e") toggleMap();
    else if (event.key.toLowerCase() === "c") toggleTwo();
    else if (event.key === "+" || event.key === "=") zoomBy(2);
    else if (event.key === "-") zoomBy(0.5);
    else return;
    event.preventDefault();
  }

  function begin() {
    const names = slots();
    pane.a = names.includes("BMFR") ? "BMFR" : names[Math.min(1, names.length - 1)];
    pane.b = REFERENCE;
    for (const which of ["a", "b"]) {
      byId(`pick-${which}`).replaceChildren(...all().map((name) => make("option", { value: name }, name)));
      byId(`pick-${which}`).onchange = (event) => show(event.target.value, which);
    }
    for (const name of names) image(picturesOf(name).picture);
    byId("viewer-say").textContent = `Frame ${scene().shown} of ${scene().name}, ${scene().motion}.`;
    fit();
    drawStrips();
  }

  // One line of pixels, frame by frame from top to bottom: what flickers has a grain from line to line.
  function drawStrips() {
    const rows = [];
    for (const name of slots()) {
      const uri = picturesOf(name).strip;
      if (!uri) continue;
      const canvas = make("canvas", { "aria-label": `${name}: one line of pixels over time` });
      const source = new Image();
      source.onload = () => {
        canvas.width = source.naturalWidth;
        canvas.height = source.naturalHeight * 3;
        const context = canvas.getContext("2d");
        context.imageSmoothingEnabled = false;
        if (name !== REFERENCE) context.drawImage(source, 0, 0, canvas.width, canvas.height);
        else for (const row of scene().scored) context.drawImage(source, 0, row, source.naturalWidth, 1, 0, 3 * row, canvas.width, 3);
      };
      source.src = uri;
      rows.push(make("span", {}, name), canvas);
    }
    byId("strips").replaceChildren(...rows);
    byId("strip-say").textContent = `The line of pixels at half the height, frame ${scene().stripFrames[0]} on top to frame ${scene().stripFrames.slice(-1)[0]} below. ` +
      "What flickers is rough from line to line; what lags is smeared. Of the reference there are only the scored frames. Below, the error in each of them.";
  }

  // Matplotlib's magma (CC0), interpolated between a few of its colours.
  function makeMagma() {
    const stops = [[0, 0, 4], [28, 16, 68], [79, 18, 123], [129, 37, 129], [181, 54, 122], [229, 80, 100], [251, 135, 97], [254, 194, 135], [252, 253, 191]];
    return Array.from({ length: 256 }, (_, value) => {
      const at = value / 255 * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2), part = at - low;
      return [...stops[low].map((c, k) => Math.round(c + (stops[low + 1][k] - c) * part)), 255];
    });
  }

  function start() {
    wire("a");
    wire("b");
    document.addEventListener("keydown", onKey);
    byId("map-button").onclick = toggleMap;
    byId("two-button").onclick = toggleTwo;
    byId("zoom-in").onclick = () => zoomBy(2);
    byId("zoom-out").onclick = () => zoomBy(0.5);
    byId("zoom-fit").onclick = fit;
    window.addEventListener("resize", draw);
  }
  return { REFERENCE, start, begin, show, slots, view: () => ({ ...view, ...pane, two, map }) };
})();
