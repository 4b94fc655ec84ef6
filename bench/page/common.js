"use strict";
// What all parts of the page share: the data, what is chosen, and small helpers.

const DATA = JSON.parse(document.getElementById("data").textContent);

const COLORS = {
  "baseline": "#6b7280", "SVGF": "#1f6fd0", "BMFR": "#d9730d", "A-SVGF": "#0f8f8f", "OIDN": "#2e9e4f",
  "spatial": "#a23fb0", "path tracing": "#111111", "others": "#8a5a2b",
};
const color = (group) => COLORS[group] || COLORS.others;

// Errors by name: label, whether less is better, and what is drawn on a logarithmic axis.
const METRICS = {
  rmse: { label: "RMSE", title: "RMSE of linear radiance", less: true, digits: 4 },
  flip: { label: "FLIP", title: "mean FLIP", less: true, digits: 4 },
  relmse: { label: "relMSE", title: "relMSE", less: true, digits: 4 },
  temporal: { label: "temporal", title: "temporal difference error", less: true, digits: 4 },
  ssim: { label: "SSIM", title: "1 − SSIM", less: false, digits: 4, drawn: (v) => 1 - v },
  psnr: { label: "PSNR", title: "RMSE on the display curve, from PSNR", less: false, digits: 2, drawn: (v) => Math.pow(10, -v / 20) },
};
const drawn = (metric, value) => (METRICS[metric].drawn && value !== null ? METRICS[metric].drawn(value) : value);

const state = { scene: 0, metric: "rmse", stages: true, listeners: [] };
const scene = () => DATA.scenes[state.scene];
function changed() { for (const listener of state.listeners) listener(); }

const byId = (id) => document.getElementById(id);

function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

const fixed = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
const time = (ms) => (ms === null ? "–" : ms < 10 ? ms.toFixed(2) : ms < 100 ? ms.toFixed(1) : ms.toFixed(0));
const escaped = (text) => String(text).replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);

// "< floor" where the reference's own noise is all that an error can be.
function bounded(value, floor, digits) {
  if (value === null) return { text: "–", under: false };
  const under = floor !== null && floor !== undefined && value < floor;
  return { text: under ? "< " + fixed(floor, digits) : fixed(value, digits), under };
}

function choices(holder, names, chosen, choose) {
  holder.replaceChildren(...names.map((name, index) =>
    make("button", { type: "button", "aria-pressed": String(index === chosen), onclick: () => choose(index) }, name)));
}

const visible = (methods) => methods.filter((m) => state.stages || !m.stage);
