// Puts "Explore" into its places on a page.
(() => {
  "use strict";
  const studies = JSON.parse(document.getElementById("page-data").textContent).explore;
  for (const box of document.querySelectorAll("[data-explore]")) {
    const study = studies[Number(box.getAttribute("data-explore"))];
    box.replaceChildren();
    (study.memory ? mapmore.exploreRunning : mapmore.exploreFixed)(box, study);
  }
  mapmore.shownAfter = performance.now();
})();
