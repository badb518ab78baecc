/* The charts of the page: one range of time for all of them, one chosen step of the ladder. No request leaves it. */
(function () {
  "use strict";
  const DATA = JSON.parse(document.getElementById("data").textContent);
  const COLORS = {
    light: { ink: "#3d4650", grid: "#e4e8ec", zero: "#9aa4ae", measured: "#0b5394", model: "#e07b00", residual: "#5b6470",
             cloud: "#5b647059", faint: "#9aa4ae", mark: "#3d4650" },
    dark: { ink: "#aeb8c2", grid: "#2b333b", zero: "#66717c", measured: "#6db3ee", model: "#ff9f40", residual: "#b4bec8",
            cloud: "#b4bec859", faint: "#66717c", mark: "#aeb8c2" },
  };
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const charts = [];
  let step = DATA.steps - 1, range = [0, DATA.end], printing = false, setting = false, sameScale = false;

  const palette = () => (dark.matches && !printing ? COLORS.dark : COLORS.light);
  const overTime = (spec) => !spec.x;
  const number = (v) => (v == null ? "–" : Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(+v.toPrecision(4)));

  /* Series of the chosen step on one axis; where only another series has a value, this one has `undefined`. */
  function table(spec, at) {
    return uPlot.join(spec.series.map((s) => s.data[Math.min(at, s.data.length - 1)]));
  }

  function limits(spec) {
    let low = Infinity, high = -Infinity;
    for (const s of spec.series) for (const [, y] of s.data) for (const v of y) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
    return low <= high ? [low, high] : [-1, 1];
  }

  function padded(low, high) {
    if (low == null || high == null || !isFinite(low) || !isFinite(high)) return [-1, 1];
    const room = 0.06 * (high - low) || 0.06 * Math.abs(high) || 1;
    return [low - room, high + room];
  }

  function options(chart, width) {
    const c = palette(), spec = chart.spec, narrow = width < 480;
    const axis = { stroke: c.ink, grid: { stroke: c.grid, width: 1 }, ticks: { stroke: c.grid, width: 1, size: 4 }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
    const line = (s) => ({
      stroke: c[s.color], width: s.points ? 0 : s.wide ? 2.5 : overTime(spec) ? 1.2 : 2, spanGaps: false,
      points: s.points ? { show: true, size: 3.5, width: 0, fill: c[s.color] } : { show: false },
      paths: s.points ? () => null : spec.stepped ? uPlot.paths.stepped({ align: 1 }) : uPlot.paths.linear(),
    });
    return {
      width, height: overTime(spec) ? (spec.low ? 150 : narrow ? 190 : 220) : narrow ? 220 : 260,
      legend: { show: false },
      cursor: overTime(spec)
        ? { sync: { key: "time", setSeries: false, filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } }
        : { drag: { x: false, y: false }, points: { size: 6 } },
      scales: {
        x: { time: false, range: overTime(spec) ? () => range : (u, low, high) => padded(low, high) },
        y: { range: (u, low, high) => (sameScale && spec.by_step ? padded(...(chart.limits = chart.limits || limits(spec))) : padded(low, high)) },
      },
      axes: [
        Object.assign({ size: overTime(spec) ? 28 : 42, space: narrow ? 60 : 70, label: overTime(spec) ? undefined : spec.x, labelSize: 16,
          values: (u, ticks) => ticks.map((v, i) => number(v) + (overTime(spec) && i === ticks.length - 1 ? " s" : "")) }, axis),
        Object.assign({ size: narrow ? 50 : 58, space: spec.low ? 24 : 34, values: (u, ticks) => ticks.map(number) }, axis),
      ],
      series: [{}].concat(spec.series.map(line)),
      hooks: {
        drawAxes: [(u) => marks(u, spec)],
        setSelect: [(u) => { if (overTime(spec) && u.select.width > 4) { const a = u.posToVal(u.select.left, "x"), b = u.posToVal(u.select.left + u.select.width, "x"); u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false); setRange(a, b); } }],
        setCursor: [(u) => readout(chart, u)],
      },
    };
  }

  /* The line of zero, and where a log begins. */
  function marks(u, spec) {
    const c = palette(), ctx = u.ctx, { left, top, width, height } = u.bbox, ratio = devicePixelRatio;
    ctx.save();
    ctx.beginPath(); ctx.rect(left, top, width, height); ctx.clip();
    ctx.lineWidth = ratio;
    if (u.scales.y.min < 0 && u.scales.y.max > 0) {
      const y = Math.round(u.valToPos(0, "y", true));
      ctx.strokeStyle = c.zero; ctx.beginPath(); ctx.moveTo(left, y); ctx.lineTo(left + width, y); ctx.stroke();
    }
    if (overTime(spec) && DATA.logs.length > 1) {
      ctx.strokeStyle = c.mark; ctx.fillStyle = c.mark; ctx.font = 11 * ratio + "px system-ui, sans-serif"; ctx.textBaseline = "top"; ctx.textAlign = "left";
      ctx.setLineDash([5 * ratio, 4 * ratio]);
      for (const log of DATA.logs) {
        const x = Math.round(u.valToPos(log.start, "x", true));
        if (log.start > 0) { ctx.beginPath(); ctx.moveTo(x, top); ctx.lineTo(x, top + height); ctx.stroke(); }
        ctx.fillText(log.name.split("/").pop().slice(0, 24), Math.max(x, left) + 4 * ratio, top + 3 * ratio);
      }
    }
    ctx.restore();
  }

  /* Values under the pointer, in the head of the panel. */
  function readout(chart, u) {
    const at = u.cursor.idx, x = at == null ? null : u.data[0][at];
    chart.cells.forEach((cell, i) => {
      const y = u.data[i + 1];
      let v = null;
      if (at != null) for (let d = 0; d < 12 && v == null; d++) v = y[at - d] ?? y[at + d] ?? null;
      cell.textContent = at == null ? "" : " " + number(v);
    });
    chart.where.textContent = x == null ? "" : overTime(chart.spec) ? stamp(x) : number(x);
  }

  function stamp(x) {
    const log = DATA.logs.filter((one) => one.start <= x).pop();
    const text = x.toFixed(Math.max(0, Math.min(6, 4 - Math.floor(Math.log10(Math.max(range[1] - range[0], 1e-9)))))) + " s";
    return DATA.logs.length > 1 && log ? log.name.split("/").pop() + " +" + (x - log.start).toFixed(3) + " s" : text;
  }

  function head(chart) {
    const spec = chart.spec, title = chart.figure.querySelector("figcaption b"), legend = chart.figure.querySelector(".legend");
    title.textContent = spec.title + (spec.unit ? " (" + spec.unit + ")" : "");
    legend.textContent = "";
    chart.box.setAttribute("role", "img");
    chart.box.setAttribute("aria-label", title.textContent);
    chart.keys = spec.series.map((s) => {
      const key = document.createElement("span"), dot = document.createElement("i");
      key.className = "key c-" + s.color;
      key.append(dot, s.name);
      legend.append(key);
      return key;
    });
    chart.cells = chart.keys.map((key) => key.appendChild(document.createElement("output")));
    chart.where = legend.appendChild(document.createElement("output"));
    chart.where.className = "where";
  }

  function draw(chart) {
    if (chart.plot) chart.plot.destroy();
    const width = chart.width = widthOf(chart);
    chart.plot = new uPlot(options(chart, width), table(chart.spec, chart.spec.by_step ? step : 0), chart.box);
    chart.box.ondblclick = () => setRange(0, DATA.end);
  }

  /* On paper the layout is another, and it is not there yet when the charts are drawn for it: A4, three side by side. */
  function widthOf(chart) {
    if (printing) return chart.figure.parentElement.className === "panels" ? 220 : 690;
    return Math.max(Math.floor(chart.box.clientWidth), 200);
  }

  function setRange(low, high) {
    const least = DATA.end * 1e-5;
    low = Math.max(0, low); high = Math.min(DATA.end, high);
    if (!(high - low > least)) return show();
    range = [low, high];
    for (const chart of charts) if (overTime(chart.spec)) chart.plot.setScale("x", { min: low, max: high });
    show();
  }

  function show() {
    const digits = Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(range[1] - range[0]))));
    const [from, to] = ["from", "to"].map((name) => document.getElementById("range-" + name));
    if (from && document.activeElement !== from) from.value = range[0].toFixed(digits);
    if (to && document.activeElement !== to) to.value = range[1].toFixed(digits);
  }

  function setStep(at) {
    step = Math.max(0, Math.min(DATA.steps - 1, at));
    for (const button of document.querySelectorAll("[role=radio][data-step]")) {
      const on = +button.dataset.step === step;
      button.setAttribute("aria-checked", String(on));
      button.tabIndex = on ? 0 : -1;
    }
    for (const block of document.querySelectorAll("details.step")) block.hidden = +block.dataset.step !== step;
    for (const chart of charts) if (chart.spec.by_step) chart.plot.setData(table(chart.spec, step));
  }

  function zoom(factor) {
    const middle = (range[0] + range[1]) / 2, half = factor * (range[1] - range[0]) / 2;
    setRange(middle - half, middle + half);
  }

  function buttons() {
    const on = (id, what) => { const at = document.getElementById(id); if (at) at.addEventListener("click", what); };
    on("zoom-in", () => zoom(0.5)); on("zoom-out", () => zoom(2)); on("zoom-all", () => setRange(0, DATA.end));
    for (const [i, name] of ["from", "to"].entries()) {
      const field = document.getElementById("range-" + name);
      if (field) field.addEventListener("change", () => { const next = range.slice(); next[i] = +field.value; field.blur(); setRange(...next); });
    }
    const steps = [...document.querySelectorAll("[role=radio][data-step]")];
    steps.forEach((button) => button.addEventListener("click", () => setStep(+button.dataset.step)));
    steps.forEach((button) => button.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (by) { event.preventDefault(); setStep(step + by); steps[step].focus(); }
    }));
    const same = document.getElementById("same-scale");
    if (same) same.addEventListener("change", () => { sameScale = same.checked; redraw((chart) => chart.spec.by_step); });
    for (const button of document.querySelectorAll("[data-copy]")) button.addEventListener("click", () => copy(button));
    for (const button of document.querySelectorAll("[data-save]")) button.addEventListener("click", () => save(button.dataset.save));
  }

  function copy(button) {
    const area = document.createElement("textarea");
    area.value = DATA.copies[button.dataset.copy];
    document.body.append(area); area.select();
    const done = document.execCommand("copy"); /* the clipboard API is not there on file:// everywhere */
    area.remove();
    const was = button.textContent;
    button.textContent = done ? "Copied" : "Select and copy";
    setTimeout(() => { button.textContent = was; }, 1500);
  }

  function save(name) {
    const text = name === "dsd.toml" ? DATA.copies.config : document.getElementById("results").textContent;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  function redraw(which) { for (const chart of charts) if (!which || which(chart)) draw(chart); }

  for (const figure of document.querySelectorAll("[data-chart]")) {
    const spec = DATA.charts[figure.dataset.chart];
    if (!spec) { figure.remove(); continue; }
    const chart = { figure, spec, box: figure.querySelector(".plot") };
    head(chart); draw(chart); charts.push(chart);
  }
  buttons(); setStep(step); show();

  let waiting = 0;
  new ResizeObserver(() => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => redraw((chart) => Math.abs(chart.width - widthOf(chart)) > 1));
  }).observe(document.querySelector("main"));
  dark.addEventListener("change", () => redraw());
  const print = (on) => { if (on !== printing) { printing = on; redraw(); } };
  addEventListener("beforeprint", () => print(true));
  addEventListener("afterprint", () => print(false));
  matchMedia("print").addEventListener("change", (event) => print(event.matches));

  window.dsd = { setRange, setStep, range: () => range.slice(), step: () => step, charts };
})();
