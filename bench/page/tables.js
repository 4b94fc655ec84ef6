// Tables that sort.

// columns: {head, value(row), text(row), cell?(row)}; the first holds names. rows that are `last` stay at the end.
function sortable(table, columns, rows, order) {
  const sorted = [...rows];
  if (order.column !== null) {
    const { value } = columns[order.column], sign = order.down ? -1 : 1;
    sorted.sort((a, b) => {
      if (!a.last !== !b.last) return a.last ? 1 : -1;
      const x = value(a), y = value(b);
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * (typeof x === "string" ? x.localeCompare(y) : x - y);
    });
  }
  const again = (column) => sortable(table, columns, rows, { column, down: order.column === column ? !order.down : false });
  const heads = columns.map((column, index) => make("th", {
    scope: "col", title: column.title || null, "aria-sort": order.column === index ? (order.down ? "descending" : "ascending") : "none",
  }, make("button", { type: "button", onclick: () => again(index) }, column.head)));
  const body = sorted.map((row) => make("tr", { class: row.class || null }, ...columns.map((column) => {
    const cell = make("td", {});
    if (column.cell) column.cell(cell, row);
    else cell.textContent = column.text(row);
    return cell;
  })));
  table.replaceChildren(make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...body));
}

function named(cell, row) {
  if (row.group) cell.append(make("i", { class: "dot", style: `background:${color(row.group)}` }));
  const shown = row.pictures ? make("a", { href: "#viewer-section", onclick: () => viewer.show(row.name) }, row.name) : row.name;
  cell.append(shown);
  cell.title = row.settings || "";
}

const tableOrder = { column: 1, down: false };
function drawTable() {
  const floors = scene().floors || {};
  const error = (name) => ({
    head: METRICS[name].label, value: (r) => r.errors[name], cell: (cell, r) => {
      const { text, under } = METRICS[name].less && !r.last ? bounded(r.errors[name], floors[name], METRICS[name].digits) : { text: fixed(r.errors[name], METRICS[name].digits), under: false };
      cell.textContent = text;
      cell.classList.toggle("under", under);
    },
  });
  const ratio = (name) => (r) => (r.equal && r.errors[name] > 0 ? r.equal[name] / r.errors[name] : null);
  const judged = (name) => (cell, r) => {
    const value = ratio(name)(r);
    cell.textContent = value === null ? "" : `${value.toFixed(2)}×`;
    if (value !== null) cell.className = value > 1 ? "good" : "bad";
  };
  const columns = [
    { head: "method", value: (r) => r.name, cell: named },
    { head: "frame ms", title: "tracing and filtering", value: (r) => r.ms, text: (r) => (r.last ? "" : time(r.ms)) },
    { head: "filter ms", value: (r) => r.filter, text: (r) => (r.last ? "" : time(r.filter)) },
    { head: "p95", title: "of the filter", value: (r) => r.p95 || null, text: (r) => (r.last || !r.p95 ? "" : time(r.p95)) },
    error("rmse"), error("relmse"), error("flip"), error("ssim"), error("psnr"), error("temporal"),
    { head: "front", value: (r) => -(Number(r.front.rmse) + Number(r.front.flip)), cell: (cell, r) => { cell.className = "mark"; cell.textContent = (r.front.rmse ? "●" : "") + (r.front.flip ? "◆" : ""); } },
    { head: "equal time", title: "paths per pixel that fit into the same time", value: (r) => (r.equal ? r.equal.samples : null), text: (r) => (r.equal ? `${r.equal.samples} path${r.equal.samples > 1 ? "s" : ""}` : "") },
    { head: "RMSE", title: "of path tracing, as a multiple of the method's", value: ratio("rmse"), cell: judged("rmse") },
    { head: "FLIP", title: "of path tracing, as a multiple of the method's", value: ratio("flip"), cell: judged("flip") },
  ];
  const rows = visible(scene().methods).map((m) => ({ ...m, class: m.front.rmse || m.front.flip ? "best" : null }));
  if (scene().floors) rows.push({ name: "noise of the reference", errors: scene().floors, front: {}, ms: null, filter: null, p95: null, last: true, class: "floor" });
  sortable(byId("table"), columns, rows, tableOrder);
  const dominated = rows.filter((r) => !r.last && r.competes && !r.front.rmse && !r.front.flip).length;
  byId("table-say").textContent = `${scene().name}: ${rows.filter((r) => !r.last).length} settings, of which ${dominated} are dominated in both RMSE and FLIP. ` +
    "Variants with anti-aliasing do not compete: it comes after what errors are taken of.";
}

function drawClaims() {
  sortable(byId("claims"), [
    { head: "method", value: (c) => c.method, text: (c) => c.method },
    { head: scene().name, value: (c) => c.what, cell: (cell, c) => { cell.textContent = c.what; cell.style.textAlign = "left"; } },
    { head: "measured", value: (c) => Number(c.value) || 0, text: (c) => c.value },
    { head: "at least", value: (c) => c.limit, text: (c) => c.limit },
    { head: "", value: (c) => Number(c.holds), cell: (cell, c) => { cell.textContent = c.holds ? "holds" : "does not hold"; cell.className = c.holds ? "good" : "bad"; } },
  ], scene().claims, { column: null, down: false });
  byId("claims-section").hidden = !scene().claims.length;
}

function drawEventsTable(events, names) {
  const columns = [
    { head: "method", value: (r) => r.name, cell: named },
    { head: "flicker at rest", value: (r) => r.flicker, text: (r) => fixed(r.flicker, 4) },
    ...names.flatMap((name) => [
      { head: `frames after ${name}`, value: (r) => (r.last ? null : r.recovery[name]), text: (r) => (r.last ? "" : r.recovery[name] === null ? `> ${Math.round(0.75 * r.errors[name].length)}` : String(r.recovery[name])) },
      { head: "steady RMSE", value: (r) => r.steady[name], text: (r) => fixed(r.steady[name], 4) },
    ]),
  ];
  const rows = visible(events.methods).map((m) => ({ ...m }));
  rows.push({ name: "noise of the reference", flicker: null, steady: events.noise, recovery: {}, last: true, class: "floor" });
  sortable(byId("events-table"), columns, rows, { column: 1, down: false });
}

function drawRest() {
  const hard = DATA.hard;
  byId("hard-section").hidden = !hard.length;
  if (hard.length) {
    byId("hard").replaceChildren(
      make("thead", {}, make("tr", {}, ...hard[0].head.map((text) => make("th", { scope: "col" }, text)))),
      ...hard.map((table) => make("tbody", {}, make("tr", { class: "group" }, make("th", { colspan: table.head.length, scope: "rowgroup" }, table.group)),
        ...table.rows.map((row) => make("tr", {}, ...row.map((text) => make("td", { class: text === "FAILS" ? "bad" : null }, text)))))));
  }
  const unit = (g, value) => (value === null ? "–" : g.unit ? `${value.toFixed(1)} ${g.unit}` : value.toFixed(4));
  const goals = DATA.goals.filter((g) => g.value !== null);
  sortable(byId("goals"), [
    { head: "goal at 640×360, two cores, llvmpipe", value: (g) => g.what, text: (g) => g.what },
    { head: "measured", value: (g) => g.value, text: (g) => unit(g, g.value) },
    { head: "at most", value: (g) => g.limit, text: (g) => `${g.limit} ${g.unit}`.trim() },
    { head: "", value: () => 0, cell: (cell, g) => { if (!DATA.quick) { cell.textContent = g.value <= g.limit ? "met" : "missed"; cell.className = g.value <= g.limit ? "good" : "bad"; } } },
  ], goals, { column: null, down: false });
  sortable(byId("tracing"), [
    { head: "tracing, one path per pixel", value: (t) => t.what, text: (t) => t.what },
    { head: "size", value: (t) => t.size, text: (t) => t.size },
    { head: "triangles", value: (t) => t.triangles, text: (t) => t.triangles.toLocaleString("en") },
    { head: "ms", value: (t) => t.frame, text: (t) => time(t.frame) },
    { head: "p95", value: (t) => t.p95, text: (t) => time(t.p95) },
    { head: "of it outside Embree", value: (t) => t.outside, text: (t) => time(t.outside) },
    { head: "10⁶ rays/s", value: (t) => t.mrays, text: (t) => fixed(t.mrays, 1) },
    { head: "rays alone", value: (t) => t.alone, text: (t) => fixed(t.alone, 1) },
  ], DATA.tracing, { column: null, down: false });
  const m = DATA.memory;
  byId("memory").textContent = m ? `Memory: ${m.megabytes_first.toFixed(1)} MB after ${m.first} frames of ${m.size.join("×")}, ${m.megabytes_last.toFixed(1)} MB after ${m.frames}.` : "";
}
