// What a mouse or finger can do on the page; it reads the same without. Needs d3, which stands above it.
"use strict";

const tip = d3.select("body").append("div").attr("class", "tip").attr("role", "status");

function hideTip() {
  tip.classed("shown", false);
}

// Near the point it tells of, and within the window.
function showTip(event, point) {
  tip.html("").append("b").text(point.series);
  for (const line of point.told) tip.append("div").text(line);
  if (point.command) tip.append("code").text(point.command);
  tip.classed("shown", true);
  const box = tip.node().getBoundingClientRect();
  tip.style("left", `${Math.max(4, Math.min(event.clientX + 12, innerWidth - box.width - 8))}px`)
    .style("top", `${event.clientY + 16 + box.height < innerHeight ? event.clientY + 16 : Math.max(4, event.clientY - box.height - 12)}px`);
}

// The nearest point of a figure within a few pixels; a click leads to its run.
function hover(canvas, points) {
  const find = event => {
    const box = canvas.select("svg").node().getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const visible = points.filter(p => !canvas.select(`[data-series="${CSS.escape(p.gid)}"].off`).node());
    return d3.quadtree(visible, p => p.x * box.width, p => p.y * box.height).find(x, y, 24) || null;
  };
  canvas.on("pointermove", event => {
    const point = find(event);
    canvas.classed("pointing", point !== null);
    point ? showTip(event, point) : hideTip();
  }).on("pointerleave", hideTip).on("click", event => {
    const point = find(event);
    const run = point && document.getElementById(`run-${point.run}`);
    if (!run) return;
    for (let d = run.closest("details"); d; d = d.parentElement.closest("details")) d.open = true;
    location.hash = run.id;
  });
}

// Two fingers, a double click, or the wheel with Ctrl: the page itself still scrolls.
function zoom(figure, canvas) {
  const inner = canvas.select("svg");
  const behaviour = d3.zoom().scaleExtent([1, 16]).filter(event => event.type === "wheel" ? event.ctrlKey : event.type !== "mousedown" || scale() > 1)
    .on("zoom", ({transform}) => {
      inner.style("transform", `translate(${transform.x}px, ${transform.y}px) scale(${transform.k})`);
      figure.classed("zoomed", transform.k > 1);
    });
  const scale = () => d3.zoomTransform(canvas.node()).k;
  behaviour.extent(() => [[0, 0], [canvas.node().clientWidth, canvas.node().clientHeight]])
    .translateExtent([[0, 0], [Infinity, Infinity]]);
  canvas.call(behaviour);
  const tools = figure.insert("div", ".canvas").attr("class", "tools");
  const button = (text, title, act) => tools.append("button").attr("type", "button").attr("title", title).text(text).on("click", act);
  button("+", "larger", () => canvas.call(behaviour.scaleBy, 1.6));
  button("−", "smaller", () => canvas.call(behaviour.scaleBy, 1 / 1.6));
  button("⟲", "whole", () => canvas.call(behaviour.transform, d3.zoomIdentity));
  return tools;
}

// A button for each series.
function toggles(tools, canvas) {
  const names = new Map();
  canvas.selectAll("[data-series]").each(function () { names.set(this.dataset.series, this.dataset.label); });
  if (names.size < 2) return;
  for (const [series, label] of names)
    tools.append("button").attr("type", "button").attr("class", "series").attr("aria-pressed", "true").text(label).on("click", function () {
      const off = this.getAttribute("aria-pressed") === "true";
      this.setAttribute("aria-pressed", String(!off));
      canvas.selectAll(`[data-series="${CSS.escape(series)}"]`).classed("off", off);
    });
}

// Rows by a column, numbers as numbers: a click on its head, once more turns it round.
function sortable(table) {
  const heads = d3.select(table).selectAll("thead th"), body = table.tBodies[0];
  const value = (row, k) => {
    const text = row.cells[k] ? row.cells[k].textContent.trim() : "";
    const found = text.replace(/^[✓✗]\s*/, "").match(/^[-−]?\d[\d.]*(e[-+]?\d+)?/i);
    return found ? Number(found[0].replace("−", "-")) : text;
  };
  heads.attr("tabindex", 0).on("click keydown", function (event) {
    if (event.type === "keydown" && event.key !== "Enter") return;
    const k = heads.nodes().indexOf(this), up = this.getAttribute("aria-sort") !== "ascending";
    heads.attr("aria-sort", null);
    this.setAttribute("aria-sort", up ? "ascending" : "descending");
    const order = (a, b) => typeof a === typeof b ? d3.ascending(a, b) : typeof a === "number" ? -1 : 1;
    const rows = [...body.rows].sort((a, b) => (up ? 1 : -1) * order(value(a, k), value(b, k)));
    body.append(...rows);
  });
}

d3.selectAll("figure").each(function () {
  const figure = d3.select(this), canvas = figure.select(".canvas");
  if (canvas.empty()) return;
  const data = figure.select("script[type='application/json']");
  if (!data.empty()) hover(canvas, JSON.parse(data.text()));
  toggles(zoom(figure, canvas), canvas);
});
document.querySelectorAll(".wide table").forEach(sortable);
// a link into something folded opens it
const unfold = () => {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let d = target && target.closest("details"); d; d = d.parentElement.closest("details")) d.open = true;
  if (target) target.scrollIntoView();
};
addEventListener("hashchange", unfold);
unfold();
