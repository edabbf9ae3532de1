// Banner over the page of the monitor, shown if the skin sends no data, or if the page receives no data. The page itself
// detects the second case, because the program may have ended.
(() => {
  const TIMEOUT_MS = 3000; // ten updates of the panel
  const banner = document.createElement("div");
  banner.id = "taxel-banner";
  banner.style.cssText =
    "position:fixed;top:0;left:0;right:0;z-index:100000;display:none;padding:0.5em;text-align:center;" +
    "background:#c0392b;color:white;font:600 1.1em sans-serif";
  let updated = null;
  let changedMs = Date.now();
  const formatTime = (ms) => new Date(ms).toTimeString().slice(0, 8);
  const update = () => {
    if (!banner.isConnected) document.body.appendChild(banner);
    const status = document.getElementById("taxel-status");
    if (status === null || document.hidden) {
      changedMs = Date.now(); // not loaded yet, or not drawn: a hidden page receives no updates
      return;
    }
    if (status.dataset.updated !== updated || status.dataset.ended === "1") {
      updated = status.dataset.updated;
      changedMs = Date.now();
    }
    const isStale = Date.now() - changedMs > TIMEOUT_MS;
    const since = status.dataset.noDataSince || (isStale ? formatTime(changedMs) : "");
    banner.textContent = since && `no data since ${since}` + (isStale ? ": the program does not respond" : "");
    banner.style.display = since ? "block" : "none";
  };
  setInterval(update, 250);
})();
