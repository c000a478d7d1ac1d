// A page with one player in it.
Replay.unpackAll(JSON.parse(document.getElementById("episodes").textContent)).then(
  (episodes) => Replay.mount(document.getElementById("player"), episodes, document),
  (error) => { document.getElementById("player").textContent = "The episodes cannot be read: " + error; });
