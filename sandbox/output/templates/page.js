const wider = new ResizeObserver(all => all.forEach(({target: w}) =>
  w.classList.toggle("over", w.scrollWidth > w.clientWidth + 1)));
document.querySelectorAll(".wide, .draw").forEach(w => wider.observe(w));
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => d.open = true));
const tools = document.body.appendChild(document.createElement("div")); tools.className = "tools";
document.querySelectorAll("figure svg").forEach(s => {
  const home = s.getAttribute("viewBox"), box = () => s.getAttribute("viewBox").split(" ").map(Number);
  const held = new Map();  // fingers, or the mouse's button, by id
  const big = () => s.classList.contains("big"), show = b => s.setAttribute("viewBox", b.join(" "));
  const zoom = (f, at) => { const [x, y, w, h] = box(), p = new DOMPoint(at.x, at.y).matrixTransform(s.getScreenCTM()
    .inverse()); show([p.x - f * (p.x - x), p.y - f * (p.y - y), f * w, f * h]); };
  const move = (a, b) => { const [x, y, w, h] = box(), c = s.getScreenCTM();
    show([x - (b.x - a.x) / c.a, y - (b.y - a.y) / c.d, w, h]); };
  const middle = { get x() { return innerWidth / 2; }, get y() { return innerHeight / 2; } };
  const close = () => { s.classList.remove("big"); show(home.split(" ")); held.clear(); tools.replaceChildren(); };
  const button = (sign, name, act) => { const b = document.createElement("button"); b.textContent = sign;
    b.setAttribute("aria-label", name); b.addEventListener("click", act); return b; };
  s.addEventListener("click", () => { if (big()) return; s.classList.add("big");
    tools.replaceChildren(button("+", "closer", () => zoom(0.7, middle)), button("−", "wider", () => zoom(1.4, middle)),
      button("×", "close", close)); });
  s.addEventListener("dblclick", () => { if (big()) close(); });
  addEventListener("keydown", e => { if (e.key === "Escape" && big()) close(); });
  s.addEventListener("wheel", e => { if (!big()) return; e.preventDefault(); zoom(e.deltaY > 0 ? 1.25 : 0.8, e); },
    {passive: false});
  s.addEventListener("pointerdown", e => { if (big()) held.set(e.pointerId, e); });
  ["pointerup", "pointercancel"].forEach(k => addEventListener(k, e => held.delete(e.pointerId)));
  s.addEventListener("pointermove", e => { const last = held.get(e.pointerId); if (!last) return;
    const other = [...held.values()].find(p => p !== last), far = p => Math.hypot(p.x - other.x, p.y - other.y);
    if (!other) move(last, e);
    else if (far(e) > 1) zoom(far(last) / far(e), {x: (e.x + other.x) / 2, y: (e.y + other.y) / 2});
    held.set(e.pointerId, e); });
});
