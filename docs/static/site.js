// Films play by themselves, but not for people who ask for less motion: these get a film that waits for them.
// A film that is out of sight rests.
document.addEventListener("DOMContentLoaded", () => {
  const still = window.matchMedia("(prefers-reduced-motion: reduce)");
  const films = [...document.querySelectorAll("video[autoplay]")];
  const seen = new Set();

  function settle(film) {
    film.controls = still.matches;
    if (still.matches || !seen.has(film)) film.pause();
    else film.play().catch(() => { film.controls = true; });
  }

  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (entry.isIntersecting) seen.add(entry.target);
      else seen.delete(entry.target);
      settle(entry.target);
    }
  });
  for (const film of films) {
    film.autoplay = false; // From here on what is in sight decides.
    watcher.observe(film);
  }
  still.addEventListener("change", () => films.forEach(settle));
});

// Results of a search show the lines around what was found. From a folder browsers let no page read another, so the
// search page has the texts of all pages in a script (extensions/excerpts.py).
if (location.protocol === "file:" && document.currentScript && /search\.html$/.test(location.pathname)) {
  const script = document.createElement("script");
  script.src = new URL("texts.js", document.currentScript.src);
  const loaded = new Promise((resolve) => { script.onload = resolve; });
  document.head.append(script);
  const folder = new URL(".", location.href).href;
  window.fetch = (url) => loaded.then(() => {
    const page = decodeURI(new URL(url, location.href).href.slice(folder.length));
    return { text: () => PAGE_TEXTS[page] ?? "" };
  });
}
