(() => {
  const nice = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find(f => f * power >= raw);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(k * step);
    return [ticks, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  };
  const show = (value, digits) => (Math.abs(value) < 1e-12 ? "0" :
    digits > 5 ? value.toExponential(2) : value.toFixed(digits)).replace("-", "\u2212");
  const parse = d => {
    const points = []; let x = 0, y = 0;
    for (const [, c, a, b] of d.matchAll(/([Ml])(-?[\d.]+) (-?[\d.]+)/g)) {
      x = c === "M" ? +a : x + +a; y = c === "M" ? +b : y + +b; points.push([x, y]);
    }
    return points;
  };
  const tip = document.body.appendChild(document.createElement("div"));
  tip.className = "tip";
  const charts = [...document.querySelectorAll("svg.chart")].map(svg => {
    const numbers = key => svg.dataset[key].split(",").map(Number);
    const [left, top, width, height] = numbers("box"), full = { x: numbers("x"), y: numbers("y") };
    const chart = { svg, link: svg.dataset.link, full, view: { x: [...full.x], y: [...full.y] } };
    const data = svg.querySelector(".data"), axes = svg.querySelector(".axes");
    const lines = [...data.querySelectorAll("[data-name]")].map(p => [p.dataset.name, parse(p.getAttribute("d"))]);
    const px = v => left + (v - chart.view.x[0]) / (chart.view.x[1] - chart.view.x[0]) * width;
    const py = v => top + (chart.view.y[1] - v) / (chart.view.y[1] - chart.view.y[0]) * height;
    const from = event => {
      const box = svg.getBoundingClientRect(), all = svg.viewBox.baseVal;
      return [(event.clientX - box.left) / box.width * all.width, (event.clientY - box.top) / box.height * all.height];
    };
    const value = ([x, y]) => [chart.view.x[0] + (x - left) / width * (chart.view.x[1] - chart.view.x[0]),
      chart.view.y[1] - (y - top) / height * (chart.view.y[1] - chart.view.y[0])];
    chart.draw = () => {
      const sx = (full.x[1] - full.x[0]) / (chart.view.x[1] - chart.view.x[0]);
      const sy = (full.y[1] - full.y[0]) / (chart.view.y[1] - chart.view.y[0]);
      data.setAttribute("transform", `matrix(${sx} 0 0 ${sy} ${px(full.x[0]) - left * sx} ${py(full.y[1]) - top * sy})`);
      const [xt, xd] = nice(...chart.view.x, 8), [yt, yd] = nice(...chart.view.y, 5);
      axes.innerHTML = xt.map(v => `<path class="g" d="M${px(v)} ${top}v${height}"/><text class="n" x="${px(v)}" y="${top + height + 16}" text-anchor="middle">${show(v, xd)}</text>`).join("") +
        yt.map(v => `<path class="g" d="M${left} ${py(v)}h${width}"/><text class="n" x="${left - 6}" y="${py(v) + 4}" text-anchor="end">${show(v, yd)}</text>`).join("");
    };
    const make = (name, cls) => svg.appendChild(Object.assign(document.createElementNS("http://www.w3.org/2000/svg", name), {})).setAttribute("class", cls);
    make("path", "cursor"); make("rect", "zoom");
    const cursor = svg.querySelector(".cursor"), zoom = svg.querySelector(".zoom");
    let begin = null;
    const inside = ([x, y]) => x >= left && x <= left + width && y >= top && y <= top + height;
    const clamp = ([x, y]) => [Math.min(Math.max(x, left), left + width), Math.min(Math.max(y, top), top + height)];
    svg.addEventListener("pointermove", event => {
      const at = from(event);
      if (begin) {
        const [x, y] = clamp(at);
        zoom.setAttribute("x", Math.min(x, begin[0])); zoom.setAttribute("width", Math.abs(x - begin[0]));
        zoom.setAttribute("y", Math.min(y, begin[1])); zoom.setAttribute("height", Math.abs(y - begin[1]));
        return;
      }
      if (!inside(at)) { tip.style.display = "none"; cursor.setAttribute("d", ""); return; }
      cursor.setAttribute("d", `M${at[0]} ${top}v${height}`);
      const [v] = value(at), x = left + (v - full.x[0]) / (full.x[1] - full.x[0]) * width;
      const digits = range => Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(range[1] - range[0]))));
      const rows = lines.filter(([name, points]) => name && points.length).map(([name, points]) => {
        let low = 0, high = points.length - 1;
        while (high - low > 1) { const m = (low + high) >> 1; if (points[m][0] < x) low = m; else high = m; }
        const p = Math.abs(points[low][0] - x) < Math.abs(points[high][0] - x) ? points[low] : points[high];
        return `${name}: ${show(full.y[1] - (p[1] - top) / height * (full.y[1] - full.y[0]), digits(chart.view.y))}`;
      });
      tip.innerHTML = [show(v, digits(chart.view.x)), ...rows].join("<br>");
      tip.style.display = "block";
      tip.style.left = Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 8) + "px";
      tip.style.top = event.clientY + 14 + "px";
    });
    svg.addEventListener("pointerleave", () => { if (!begin) { tip.style.display = "none"; cursor.setAttribute("d", ""); } });
    svg.addEventListener("pointerdown", event => {
      const at = from(event);
      if (event.button === 0 && inside(at)) { begin = at; svg.setPointerCapture(event.pointerId); event.preventDefault(); }
    });
    svg.addEventListener("pointerup", event => {
      if (!begin) return;
      const a = value(begin), b = value(clamp(from(event)));
      const wide = Math.abs(+zoom.getAttribute("width")) > 6, tall = Math.abs(+zoom.getAttribute("height")) > 6;
      begin = null; zoom.setAttribute("width", 0); zoom.setAttribute("height", 0);
      if (!wide) return;
      apply(chart, [Math.min(a[0], b[0]), Math.max(a[0], b[0])], tall ? [Math.min(a[1], b[1]), Math.max(a[1], b[1])] : null);
    });
    svg.addEventListener("dblclick", () => apply(chart, null, null));
    return chart;
  });
  const apply = (chart, x, y) => charts.filter(c => c === chart || (chart.link && c.link === chart.link)).forEach(c => {
    c.view.x = x ? [...x] : [...c.full.x];
    if (!x) c.view.y = [...c.full.y]; else if (c === chart && y) c.view.y = [...y];
    c.draw();
  });
})();
