// Show the tooltip of what is pointed at, tapped or focused.
const tip = document.getElementById("tip");

function showTip(target) {
  tip.hidden = !target;
  if (!target) return;
  tip.textContent = target.dataset.tip;
  const at = target.getBoundingClientRect(), own = tip.getBoundingClientRect();
  const left = Math.min(Math.max(at.left + at.width / 2 - own.width / 2, 8), document.documentElement.clientWidth - own.width - 8);
  const above = at.top - own.height - 8;
  Object.assign(tip.style, { left: `${left}px`, top: `${above > 4 ? above : at.bottom + 8}px` });
}

for (const kind of ["pointerover", "focusin", "click"]) {
  document.addEventListener(kind, ({ target }) => showTip(target.closest?.("[data-tip]")));
}
document.addEventListener("scroll", () => showTip(null), { passive: true, capture: true });

const payloads = new Map([...document.querySelectorAll("script.replay")]
  .map((script) => [script.dataset.name, { header: JSON.parse(script.textContent), data: script.nextElementSibling.textContent }]));
if (payloads.size) {
  const root = document.getElementById("player");
  root.player = new Player(root, payloads, JSON.parse(document.getElementById("methods").textContent));
  root.player.open(payloads.keys().next().value);
}
