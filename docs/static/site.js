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

// Results of a search show the lines around what was found, which browsers do not let pages read from a folder.
if (location.protocol === "file:" && typeof DOCUMENTATION_OPTIONS !== "undefined") {
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
}
