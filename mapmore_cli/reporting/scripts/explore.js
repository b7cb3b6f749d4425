// Start each section "Explore" of a page; the page already contains the controls.
import { exploreFixed } from "./fixed.js";
import { exploreRunning } from "./running.js";

const { explore } = JSON.parse(document.getElementById("page-data").textContent);
for (const box of document.querySelectorAll("[data-explore]")) {
  const study = explore[Number(box.getAttribute("data-explore"))];
  box.removeAttribute("hidden");
  (study.memory ? exploreRunning : exploreFixed)(box, study);
}
mapmore.shownAfter = performance.now();
