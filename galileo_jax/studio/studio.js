// One time for the video and all curves; files dropped on the page.
(() => {
  const line = (graph) => {
    const layout = graph._fullLayout;
    if (!layout || !graph.closest(".timed")) return;
    let mark = graph.querySelector(":scope > .cursor");
    if (!mark) { mark = document.createElement("div"); mark.className = "cursor"; graph.append(mark); }
    const axis = layout.xaxis, time = window.galileoTime || 0;
    const x = axis._offset + axis.d2p(time);
    const inside = x >= axis._offset - 1 && x <= axis._offset + axis._length + 1;
    Object.assign(mark.style, { left: `${x}px`, top: `${layout._size.t}px`,
      height: `${layout._size.h}px`, display: inside ? "block" : "none" });
  };
  const all = () => document.querySelectorAll(".timed .js-plotly-plot").forEach(line);
  window.addEventListener("galileo-time", all);
  setInterval(() => document.querySelectorAll(".timed .js-plotly-plot").forEach((graph) => {
    if (!graph.on || graph.galileo) return;
    graph.galileo = true;
    new ResizeObserver(() => dispatchEvent(new Event("resize"))).observe(graph.parentElement);
    graph.on("plotly_click", (event) =>
      window.dispatchEvent(new CustomEvent("galileo-go", { detail: event.points[0].x })));
    graph.on("plotly_afterplot", () => line(graph));
    line(graph);
  }), 300);
  const send = async (file) => {
    const say = (text, isWrong) => window.dispatchEvent(
      new CustomEvent("galileo-said", { detail: { text, isWrong } }));
    say(`${file.name} …`);
    try {
      const answer = await fetch(`/upload/${encodeURIComponent(file.name)}`, { method: "PUT", body: file });
      say(await answer.text(), !answer.ok);
    } catch (error) { say(`${file.name}: not taken; too large?`, true); }
  };
  window.galileoUpload = async (files) => { for (const file of files) await send(file); };
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer) window.galileoUpload(event.dataTransfer.files);
  });
  addEventListener("galileo-said", (event) => {
    const place = document.querySelector(".said");
    if (!place) return;
    place.textContent = event.detail.text;
    place.classList.toggle("trouble", Boolean(event.detail.isWrong));
  });
})();
