"use strict";
// Draws a page's charts in the page's colours, and moves its clips. No library but Plotly,
// which the page carries compressed.
(() => {
  const players = new Map(); // clip -> function that shows a time

  // ---- charts

  const isTouch = matchMedia("(pointer: coarse)").matches;

  // Figures have the colours of light pages, by the style sheet's first rule; dark pages have
  // others of the same names.
  const light = document.styleSheets[0].cssRules[0].style;
  const names = new Map(
    [...light].filter((name) => light.getPropertyValue(name).trim().startsWith("#"))
      .map((name) => [triple(light.getPropertyValue(name)), name]),
  );

  function triple(hex) {
    return [1, 3, 5].map((i) => parseInt(hex.trim().slice(i, i + 2), 16)).join(",");
  }

  function painted(value, css) {
    if (Array.isArray(value)) return value.map((item) => painted(item, css));
    if (value && typeof value === "object")
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, painted(v, css)]));
    const found = typeof value === "string" && /^rgba\((\d+,\d+,\d+),([\d.]+)\)$/.exec(value);
    if (!found || !names.has(found[1])) return value;
    return `rgba(${triple(css.getPropertyValue(names.get(found[1])))},${found[2]})`;
  }

  function figureOf(box) {
    const css = getComputedStyle(document.documentElement);
    const { data, layout } = JSON.parse(box.querySelector("script").textContent);
    layout.font = { family: css.getPropertyValue("--sans") };
    layout.dragmode = isTouch ? false : "zoom";
    for (const key of Object.keys(layout).filter((k) => /^[xy]axis\d*$/.test(k)))
      layout[key].fixedrange = isTouch;
    return painted({ data, layout }, css);
  }

  function draw(box) {
    if (box.plot) return;
    box.plot = document.createElement("div");
    box.plot.className = "plot";
    box.append(box.plot);
    const { data, layout } = figureOf(box);
    Plotly.newPlot(box.plot, data, layout, {
      responsive: false,
      displayModeBar: isTouch ? false : "hover",
      displaylogo: false,
      modeBarButtons: [["toImage"]],
      toImageButtonOptions: { format: "svg", filename: box.getAttribute("aria-label") },
    });
    const clip = box.dataset.clip;
    if (clip === undefined) return;
    box.playhead = document.createElement("div");
    box.playhead.className = "playhead";
    box.playhead.hidden = true;
    box.append(box.playhead);
    box.plot.on("plotly_afterplot", () => placePlayhead(box));
    box.plot.on("plotly_click", (event) => players.get(clip)?.(event.points[0].x));
  }

  function placePlayhead(box) {
    if (!box.playhead || box.time === undefined) return;
    const { xaxis, _size: size } = box.plot._fullLayout;
    const left = xaxis._offset + xaxis.l2p(box.time);
    box.playhead.hidden = !(left >= size.l && left <= size.l + size.w);
    Object.assign(box.playhead.style, {
      left: `${left}px`, top: `${size.t}px`, height: `${size.h}px`,
    });
  }

  function pointAt(clip, time) {
    for (const box of document.querySelectorAll(".chart[data-clip]"))
      if (box.dataset.clip === clip) {
        box.time = time;
        placePlayhead(box);
      }
  }

  async function loadPlotly(packed) {
    const bytes = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
    packed.remove();
  }

  async function startCharts() {
    const boxes = [...document.querySelectorAll(".chart")];
    const packed = document.getElementById("plotly");
    if (!boxes.length || !packed) return;
    await loadPlotly(packed);
    const near = new IntersectionObserver(
      (seen) => {
        for (const { isIntersecting, target } of seen)
          if (isIntersecting) { near.unobserve(target); draw(target); }
      },
      { rootMargin: "800px 0px" },
    );
    const sized = new ResizeObserver((changed) => {
      for (const { target } of changed)
        if (target.plot && target.clientWidth) Plotly.Plots.resize(target.plot);
    });
    for (const box of boxes) { near.observe(box); sized.observe(box); }
    addEventListener("beforeprint", () => boxes.forEach(draw));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const box of boxes.filter((one) => one.plot)) {
        const { data, layout } = figureOf(box);
        Plotly.react(box.plot, data, layout);
      }
    });
  }

  // ---- clips

  function startMotion(box) {
    const data = JSON.parse(box.querySelector("script").textContent);
    const slider = box.querySelector("input"), play = box.querySelector("button");
    const clock = box.querySelector("output"), canvas = box.querySelector("canvas");
    const shapes = [...box.querySelectorAll("[data-of]")];
    const pictures = data.pictures.map((uri) => Object.assign(new Image(), { src: uri }));
    const last = data.times.length - 1;

    function paint(frame) {
      const picture = pictures[frame];
      if (!canvas || !picture) return;
      if (!picture.complete) { picture.onload = () => +slider.value === frame && paint(frame); return; }
      canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
      canvas.dataset.frame = frame;
    }

    function show() {
      const frame = +slider.value, time = data.times[frame];
      clock.value = time.toFixed(2) + " s";
      slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds, step ${frame + 1} of ${last + 1}`);
      for (const shape of shapes) {
        const place = data.motions[shape.dataset.of][shape.dataset.object][frame];
        shape.style.display = place ? "" : "none";
        if (place) shape.setAttribute("transform",
          `translate(${place[0]} ${place[1]}) rotate(${place[2]})`);
      }
      paint(frame);
    }

    let running = null, start = 0;
    function stop() { cancelAnimationFrame(running); running = null; play.textContent = "Play"; }
    function tick(now) {
      const at = data.times[0] + (now - start) / 1000 / data.slower;
      const next = data.times.findIndex((time) => time >= at);
      slider.value = next < 0 ? last : next;
      show(); pointAt(box.dataset.clip, data.times[+slider.value]);
      if (+slider.value < last) running = requestAnimationFrame(tick); else stop();
    }
    play.onclick = () => {
      if (running !== null) return stop();
      const from = +slider.value < last ? +slider.value : 0;
      start = performance.now() - 1000 * data.slower * (data.times[from] - data.times[0]);
      play.textContent = "Stop"; running = requestAnimationFrame(tick);
    };
    slider.oninput = () => {
      if (running !== null) stop();
      show(); pointAt(box.dataset.clip, data.times[+slider.value]);
    };
    players.set(box.dataset.clip, (time) => {
      const distance = data.times.map((one) => Math.abs(one - time));
      slider.value = distance.indexOf(Math.min(...distance));
      slider.oninput();
    });
    show();
  }

  document.querySelectorAll(".motion").forEach(startMotion);
  startCharts().catch((reason) => {
    const note = document.createElement("p");
    note.className = "warn";
    note.textContent = `The charts cannot be drawn in this browser (${reason}); the numbers below hold.`;
    document.querySelector("header, body").append(note);
  });
})();
