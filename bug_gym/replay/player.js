"use strict";
// Plays episodes on canvases: `Replay.unpackAll(letters)` reads them, `Replay.mount(root, episodes, keys)` shows them side
// by side. Texts come into the page as text nodes only. Nothing is told by colour alone: labels have marks and dashes.
const Replay = (() => {
  const POINT = 0, AREA = 2; // what a shape is; 1 is a segment
  const SPARSE = 0.21; // angle between two beams [rad] from which on they are rays: an area would claim what lies between
  const HORIZON = 1.5; // a dart reaches as far as a mover comes in this time [s]
  const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
  const TICK = 15; // between two looks at the clock while it plays [ms]
  const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [14, 4]];
  const MARKS = ["disc", "square", "triangle", "diamond", "cross", "ring", "plus", "wedge"];
  const COLORS = 6; // of robots, and of labels

  // -- Reading ----------------------------------------------------------------------------------------------------------

  async function unpack(letters) {
    const bytes = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
    const stream = new DecompressionStream("deflate"), writer = stream.writable.getWriter();
    const written = Promise.all([writer.write(bytes), writer.close()]);
    const [text] = await Promise.all([new Response(stream.readable).text(), written]);
    return prepared(JSON.parse(text));
  }

  const unpackAll = (many) => Promise.all(many.map(unpack));

  // Changes from frame to frame as values: column after column, each of as many numbers as there are frames.
  function summed(numbers, frames, unit) {
    const columns = numbers.length / frames, values = new Float64Array(numbers.length);
    for (let column = 0; column < columns; column += 1) {
      let sum = 0;
      for (let frame = 0; frame < frames; frame += 1) {
        sum += numbers[column * frames + frame];
        values[frame * columns + column] = sum * unit;
      }
    }
    return { columns, at: (frame) => values.subarray(frame * columns, (frame + 1) * columns) };
  }

  const pairs = (numbers, unit) =>
    Array.from({ length: numbers.length / 2 }, (_, place) => [numbers[2 * place] * unit, numbers[2 * place + 1] * unit]);

  function prepared(data) {
    const over = (name, unit) => summed(data[name], data.frames, unit);
    const shapes = data.shapes.map(([kind, label, ...numbers]) => {
      const count = numbers.length / 2, places = summed(numbers, count, 0.01);
      return { kind, label, places: Array.from({ length: count }, (_, place) => [...places.at(place)]) };
    });
    let last = [];
    const shown = data.shown.map((spans) => {
      if (spans === 0) return last;
      last = [];
      for (let at = 0; at < spans.length; at += 2)
        for (let number = 0; number < spans[at + 1]; number += 1) last.push(shapes[spans[at] + number]);
      return last;
    });
    return {
      ...data, shown,
      times: over("times", 0.001), poses: over("poses", 0.001), goals: over("goals", 0.001), places: over("places", 0.001),
      velocities: over("velocities", 0.01), ranges: over("ranges", 0.01), outcomes: over("outcomes", 1), notes: over("notes", 1),
      border: pairs(data.border, 0.001),
      polygons: data.polygons.map((rings) => rings.map((ring) => pairs(ring, 0.001))),
      regions: data.regions.map((region) => ({ ...region, rings: region.rings.map((ring) => pairs(ring, 0.001)) })),
      movers: data.movers.map((outline) => (outline.length === 1 ? outline[0] * 0.001 : pairs(outline, 0.001))),
      angles: data.angles.map((angle) => angle * 0.001),
    };
  }

  const outcomeOf = (episode, frame) => {
    const names = [...episode.outcomes.at(frame)].map((code) => episode.outcomeNames[code]);
    return ["running", "collision", "timeout", "success"].find((name) => names.includes(name)) ?? names[0];
  };

  const SURROUNDINGS = 0.06; // what is shown around everything that there is, as a share of its longer side

  // The part of a world in which something is: obstacles, goals, movers and robots on their ways.
  function boxOf(episode) {
    const columns = [[], []];
    const add = (x, y, radius = 0) => { columns[0].push(x - radius, x + radius); columns[1].push(y - radius, y + radius); };
    episode.polygons.forEach((rings) => rings[0].forEach(([x, y]) => add(x, y)));
    episode.regions.forEach(({ rings }) => rings[0].forEach(([x, y]) => add(x, y)));
    for (let at = 0; at < episode.circles.length; at += 3)
      add(...episode.circles.slice(at, at + 3).map((number) => number * 0.001));
    for (let frame = 0; frame < episode.frames; frame += 1) {
      const poses = episode.poses.at(frame), goals = episode.goals.at(frame), places = episode.places.at(frame);
      for (let at = 0; at < poses.length; at += 3) add(poses[at], poses[at + 1], 0.5);
      for (let at = 0; at < goals.length; at += 2) add(goals[at], goals[at + 1], episode.goalRadius);
      for (let at = 0; at < places.length; at += 2) add(places[at], places[at + 1], 0.5);
    }
    const [left, bottom] = columns.map((values) => values.reduce((a, b) => Math.min(a, b), Infinity));
    const [right, top] = columns.map((values) => values.reduce((a, b) => Math.max(a, b), -Infinity));
    const span = Math.max(right - left, top - bottom), more = SURROUNDINGS * span, [first, low, last, high] = episode.box;
    // Where the border is not far, all of it is shown.
    const least = (side, edge) => (side - edge < 3 * more ? edge : side - more);
    return [least(left, first), least(bottom, low), -least(-right, -last), -least(-top, -high)];
  }

  // The same part for all episodes of one world, so that they can be compared.
  function boxes(episodes) {
    const found = new Map();
    for (const episode of episodes) {
      const world = `${episode.seed} ${episode.scenario}`, own = boxOf(episode), other = found.get(world) ?? own;
      found.set(world, own.map((side, at) => (at < 2 ? Math.min(side, other[at]) : Math.max(side, other[at]))));
    }
    return episodes.map((episode) => found.get(`${episode.seed} ${episode.scenario}`));
  }

  // -- Drawing -----------------------------------------------------------------------------------------------------------

  function palette(root) {
    const style = getComputedStyle(root), colors = {};
    for (const name of ["ink", "paper", "faint", "floor", "still", "rim", "mover", "mover-rim", "goal", "ground"])
      colors[name] = style.getPropertyValue("--" + name).trim();
    for (const kind of ["robot", "mind"])
      colors[kind] = Array.from({ length: COLORS }, (_, number) => style.getPropertyValue(`--${kind}-${number}`).trim());
    return colors;
  }

  function path(context, places, isClosed = true) {
    context.beginPath();
    trace(context, places, isClosed);
  }

  function trace(context, places, isClosed = true) {
    places.forEach(([x, y], number) => (number ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (isClosed) context.closePath();
  }

  function disc(context, [x, y], radius, fill, rim, width = 1) {
    context.beginPath();
    context.arc(x, y, Math.max(radius, 1), 0, 2 * Math.PI);
    if (fill) { context.fillStyle = fill; context.fill(); }
    if (rim) { context.strokeStyle = rim; context.lineWidth = width; context.stroke(); }
  }

  // A ring counter-clockwise, so that rings that overlap do not cut holes into one another.
  function turned(ring) {
    const area = ring.reduce((sum, [x, y], at) => {
      const [nextX, nextY] = ring[(at + 1) % ring.length];
      return sum + x * nextY - y * nextX;
    }, 0);
    return area < 0 ? [...ring].reverse() : ring;
  }

  // One mark of a label, with a light edge that lifts it off what lies beneath.
  function mark(context, kind, [x, y], size, color, edge) {
    const corners = {
      square: [[-1, -1], [1, -1], [1, 1], [-1, 1]], triangle: [[0, -1.2], [1.1, 0.9], [-1.1, 0.9]],
      wedge: [[0, 1.2], [1.1, -0.9], [-1.1, -0.9]], diamond: [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
    }[kind];
    const strokes = {
      cross: [[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]], plus: [[[-1.2, 0], [1.2, 0]], [[0, -1.2], [0, 1.2]]],
    }[kind];
    const at = ([ahead, down]) => [x + ahead * size, y + down * size];
    context.setLineDash([]);
    context.beginPath();
    if (corners) trace(context, corners.map(at));
    else if (strokes) strokes.forEach((ends) => trace(context, ends.map(at), false));
    else context.arc(x, y, size, 0, 2 * Math.PI);
    context.strokeStyle = edge; context.lineWidth = strokes || kind === "ring" ? 4.5 : 2.5; context.stroke();
    if (strokes || kind === "ring") { context.strokeStyle = color; context.lineWidth = 2; context.stroke(); }
    else { context.fillStyle = color; context.fill(); }
  }

  const styleOf = (number, colors) => ({
    color: colors.mind[number % COLORS], mark: MARKS[number % MARKS.length], dash: DASHES[number % DASHES.length],
  });

  class Pane {
    constructor(episode, box, labels, root) {
      Object.assign(this, { episode, box, root, styles: episode.labels.map((label) => labels.indexOf(label)) });
      this.figure = document.createElement("figure");
      this.state = document.createElement("div");
      this.state.className = "state";
      this.canvas = document.createElement("canvas");
      const caption = document.createElement("figcaption"), title = document.createElement("b");
      title.textContent = episode.title || "episode";
      caption.append(title, `${episode.scenario}, seed ${episode.seed}`, this.state);
      this.figure.append(caption, this.canvas);
      this.canvas.setAttribute("role", "img");
    }

    // Fits the canvas into the room there is, with others above one another or not; sharp on every screen.
    resize(above) {
      const [left, bottom, right, top] = this.box, margin = 10;
      const room = this.figure.clientWidth, highest = Math.max(200, (above > 1 ? 0.7 / above : 0.66) * window.innerHeight);
      const scale = Math.min((room - 2 * margin) / (right - left), (highest - 2 * margin) / (top - bottom));
      if (!(scale > 0)) return;
      const width = Math.round(scale * (right - left) + 2 * margin), height = Math.round(scale * (top - bottom) + 2 * margin);
      const ratio = window.devicePixelRatio || 1;
      Object.assign(this, { width, height, ratio, scale });
      this.pixel = ([x, y]) => [margin + scale * (x - left), height - margin - scale * (y - bottom)];
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
      this.canvas.style.width = width + "px";
      this.canvas.style.height = height + "px";
      this.colors = palette(this.root);
      this.still = null;
    }

    context(canvas) {
      const context = canvas.getContext("2d");
      context.lineJoin = "round"; // from the first stroke on: a frame looks the same whatever was drawn before it
      context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
      return context;
    }

    pixels(places) { return places.map(this.pixel); }

    // What stands, painted once; the floor is left open.
    standing() {
      if (this.still) return this.still;
      this.still = document.createElement("canvas");
      this.still.width = this.canvas.width;
      this.still.height = this.canvas.height;
      const context = this.context(this.still), { episode, colors } = this, border = this.pixels(episode.border);
      context.lineWidth = 1.25;
      for (const rings of episode.polygons) {
        context.beginPath();
        rings.forEach((ring) => trace(context, this.pixels(ring)));
        context.fillStyle = colors.still; context.fill("evenodd");
        context.strokeStyle = colors.rim; context.stroke();
      }
      for (let at = 0; at < episode.circles.length; at += 3) {
        const [x, y, radius] = episode.circles.slice(at, at + 3).map((number) => number * 0.001);
        disc(context, this.pixel([x, y]), this.scale * radius, colors.still, colors.rim, 1.25);
      }
      context.beginPath(); // over what sticks out of the border
      context.rect(0, 0, this.width, this.height);
      trace(context, border);
      context.fillStyle = colors.paper; context.fill("evenodd");
      path(context, border);
      context.strokeStyle = colors.ink; context.lineWidth = 2; context.stroke();
      return this.still;
    }

    draw(number, options) {
      if (!this.pixel) return;
      const { episode, colors } = this, frame = Math.min(number, episode.frames - 1), context = this.context(this.canvas);
      context.setLineDash([]);
      context.fillStyle = colors.floor;
      context.fillRect(0, 0, this.width, this.height);
      const ends = options.scan ? this.scans(frame) : [];
      ends.forEach((scan, robot) => this.paintScan(context, scan, robot));
      this.paintGround(context);
      const shapes = options.mind ? episode.shown[frame] : [];
      this.paintAreas(context, shapes.filter((shape) => shape.kind === AREA));
      this.paintGoalAreas(context, frame);
      context.drawImage(this.standing(), 0, 0, this.width, this.height);
      this.paintMovers(context, frame);
      ends.forEach((scan, robot) => this.paintReturns(context, scan, robot));
      shapes.forEach((shape) => shape.kind !== AREA && shape.kind !== POINT && this.paintShape(context, shape));
      if (options.track) this.paintTracks(context, frame);
      shapes.forEach((shape) => shape.kind === POINT && this.paintShape(context, shape));
      this.paintGoals(context, frame);
      for (let robot = 0; robot < episode.robots; robot += 1) this.paintRobot(context, frame, robot);
      this.paintScale(context);
      this.tell(frame);
    }

    // A bar for scale, of 1, 2, 5, 10, ... metres.
    paintScale(context) {
      const longest = (0.2 * this.width) / this.scale, power = 10 ** Math.floor(Math.log10(longest));
      const metres = power * [5, 2, 1].find((times) => times * power <= longest);
      const right = this.width - 16, left = right - metres * this.scale, y = this.height - 15;
      for (const [color, width] of [[this.colors.paper, 5], [this.colors.faint, 2]]) {
        path(context, [[left, y], [right, y]], false);
        context.strokeStyle = color; context.lineWidth = width; context.stroke();
      }
      context.font = "11px system-ui, sans-serif";
      context.textAlign = "right";
      context.strokeStyle = this.colors.paper; context.lineWidth = 3; context.strokeText(metres + " m", right, y - 5);
      context.fillStyle = this.colors.faint; context.fillText(metres + " m", right, y - 5);
    }

    tell(frame) {
      const outcome = outcomeOf(this.episode, frame), note = this.episode.noteTexts[this.episode.notes.at(frame)[0]];
      const isLast = frame === this.episode.frames - 1;
      const end = outcome !== "running" ? outcome : isLast ? "ended" : "";
      const told = [this.episode.times.at(frame)[0].toFixed(1) + " s", end, note].filter(Boolean).join(" \u00b7 ");
      if (this.state.textContent === told) return;
      this.state.textContent = told;
      this.canvas.setAttribute("aria-label", `${this.episode.title} in ${this.episode.scenario}: ${told}`);
    }

    pose(frame, robot) { return this.episode.poses.at(frame).subarray(3 * robot, 3 * robot + 3); }

    // Where each robot's beams end, and whether on something.
    scans(frame) {
      const { episode } = this, ranges = episode.ranges.at(frame), beams = episode.angles.length;
      return Array.from({ length: episode.robots }, (_, robot) => {
        const [x, y, heading] = this.pose(frame, robot), at = this.pixel([x, y]);
        const ends = episode.angles.map((angle, beam) => {
          const range = ranges[robot * beams + beam];
          return this.pixel([x + range * Math.cos(heading + angle), y + range * Math.sin(heading + angle)]);
        });
        return { at, ends, seen: ends.filter((_, beam) => ranges[robot * beams + beam] < episode.range - 0.005) };
      });
    }

    paintScan(context, { at, ends }, robot) {
      const { angles, isFullCircle } = this.episode, color = this.colors.robot[robot % COLORS];
      context.lineWidth = 0.75;
      context.strokeStyle = color;
      context.fillStyle = color;
      if (ends.length < 3 || angles[1] - angles[0] > SPARSE) {
        context.globalAlpha = 0.5;
        context.beginPath();
        for (const end of ends) trace(context, [at, end], false);
        context.stroke();
      } else {
        path(context, isFullCircle ? ends : [at, ...ends]);
        context.globalAlpha = 0.13; context.fill();
        context.globalAlpha = 0.35; context.stroke();
      }
      context.globalAlpha = 1;
    }

    paintReturns(context, { seen }, robot) {
      context.fillStyle = this.colors.robot[robot % COLORS];
      for (const [x, y] of seen) context.fillRect(x - 1.25, y - 1.25, 2.5, 2.5);
    }

    // Ground that slows down: tinted, and told by its factor.
    paintGround(context) {
      const { colors } = this;
      for (const { factor, rings, place } of this.episode.regions) {
        context.beginPath();
        rings.forEach((ring) => trace(context, this.pixels(ring)));
        context.globalAlpha = 0.5 * (1 - 1 / factor);
        context.fillStyle = colors.ground; context.fill("evenodd");
        context.globalAlpha = 1;
        context.strokeStyle = colors.ground; context.lineWidth = 1; context.stroke();
        if (!place) continue;
        context.fillStyle = colors.ink;
        context.font = "12px system-ui, sans-serif";
        context.textAlign = "center";
        context.fillText("\u00d7 " + factor, ...this.pixel(place));
      }
    }

    paintMovers(context, frame) {
      const { episode, colors } = this, places = episode.places.at(frame), velocities = episode.velocities.at(frame);
      const each = (paint) => episode.movers.forEach((outline, mover) => paint(outline,
        [places[2 * mover], places[2 * mover + 1]], [velocities[2 * mover], velocities[2 * mover + 1]]));
      context.strokeStyle = colors["mover-rim"];
      each((outline, [x, y], [vx, vy]) => {
        const speed = Math.hypot(vx, vy);
        if (speed === 0) return;
        const own = typeof outline === "number" ? outline : Math.max(...outline.map((corner) => Math.hypot(...corner)));
        this.dart(context, [x, y], Math.atan2(vy, vx), own, HORIZON * speed, colors["mover-rim"]);
      });
      each((outline, [x, y]) => {
        if (typeof outline === "number") {
          disc(context, this.pixel([x, y]), this.scale * outline, colors.mover, colors["mover-rim"], 1.25);
          return;
        }
        path(context, outline.map(([dx, dy]) => this.pixel([x + dx, y + dy])));
        context.fillStyle = colors.mover; context.fill();
        context.lineWidth = 1.25; context.strokeStyle = colors["mover-rim"]; context.stroke();
      });
    }

    // An arrow from the middle of a mover, of a reach beyond its rim [m].
    dart(context, [x, y], heading, rim, reach, color) {
      const cos = Math.cos(heading), sin = Math.sin(heading), width = 2.5 / this.scale;
      const neck = Math.max(rim + reach - 6 / this.scale, rim);
      const corners = [[0, 0], [neck, width], [rim + reach, 0], [neck, -width]];
      path(context, corners.map(([ahead, left]) => this.pixel([x + cos * ahead - sin * left, y + sin * ahead + cos * left])));
      context.fillStyle = color; context.fill();
    }

    // The areas of a label as one: where many lie upon one another they are as light as one alone, with one outline.
    paintAreas(context, shapes) {
      for (const label of new Set(shapes.map((shape) => shape.label))) {
        const style = styleOf(this.styles[label], this.colors), layer = document.createElement("canvas");
        layer.width = this.canvas.width;
        layer.height = this.canvas.height;
        const above = this.context(layer);
        above.beginPath();
        for (const shape of shapes) if (shape.label === label) trace(above, this.pixels(turned(shape.places)));
        above.setLineDash(style.dash);
        above.strokeStyle = above.fillStyle = style.color;
        above.lineWidth = 2.5;
        above.stroke();
        above.globalCompositeOperation = "destination-out"; // leaves the outer half of the outline
        above.fill();
        above.globalCompositeOperation = "source-over";
        above.globalAlpha = 0.18;
        above.fill();
        context.drawImage(layer, 0, 0, this.width, this.height);
      }
    }

    paintShape(context, { kind, label, places }) {
      const style = styleOf(this.styles[label], this.colors), pixels = this.pixels(places);
      if (kind === POINT) {
        mark(context, style.mark, pixels[0], 3.6, style.color, this.colors.paper);
        return;
      }
      path(context, pixels, false);
      context.setLineDash(style.dash);
      context.strokeStyle = style.color; context.lineWidth = 1.75; context.stroke();
      context.setLineDash([]);
    }

    goalColor(goal) {
      return this.episode.goals.columns === 2 ? this.colors.goal : this.colors.robot[goal % COLORS];
    }

    eachGoal(frame, paint) {
      const goals = this.episode.goals.at(frame);
      for (let goal = 0; goal < goals.length / 2; goal += 1) paint([goals[2 * goal], goals[2 * goal + 1]], goal);
    }

    paintGoalAreas(context, frame) {
      this.eachGoal(frame, (place, goal) => {
        context.globalAlpha = 0.3;
        disc(context, this.pixel(place), this.scale * this.episode.goalRadius, this.goalColor(goal));
        context.globalAlpha = 1;
        disc(context, this.pixel(place), this.scale * this.episode.goalRadius, null, this.goalColor(goal));
      });
    }

    // A flag on each goal.
    paintGoals(context, frame) {
      this.eachGoal(frame, (place, goal) => {
        const [x, y] = this.pixel(place), color = this.goalColor(goal);
        path(context, [[x, y], [x, y - 15]], false);
        context.strokeStyle = this.colors.paper; context.lineWidth = 4; context.stroke();
        context.strokeStyle = color; context.lineWidth = 1.75; context.stroke();
        path(context, [[x, y - 16], [x + 12, y - 11.5], [x, y - 7]]);
        context.fillStyle = color; context.fill();
        context.strokeStyle = this.colors.paper; context.lineWidth = 1; context.stroke();
      });
    }

    paintTracks(context, frame) {
      const { episode, colors } = this, goals = episode.goals.columns / 2;
      for (let goal = 0; goal < goals; goal += 1)
        this.paintTrack(context, frame, (at) => episode.goals.at(at).subarray(2 * goal, 2 * goal + 2), this.goalColor(goal), 1);
      for (let robot = 0; robot < episode.robots; robot += 1) {
        const color = colors.robot[robot % COLORS];
        this.paintTrack(context, frame, (at) => this.pose(at, robot), color, 2);
        disc(context, this.pixel(this.pose(0, robot)), 4, colors.paper, color, 1.75);
      }
    }

    paintTrack(context, frame, placeAt, color, width) {
      context.beginPath();
      for (let at = 0; at <= frame; at += 1) {
        const [x, y] = this.pixel(placeAt(at));
        if (at) context.lineTo(x, y); else context.moveTo(x, y);
      }
      context.strokeStyle = this.colors.paper; context.lineWidth = width + 2; context.stroke();
      context.strokeStyle = color; context.lineWidth = width; context.stroke();
    }

    // The body with its heading; a ring about it when it is out of play, a burst where it hit something.
    paintRobot(context, frame, robot) {
      const { episode, colors, scale } = this, [x, y, heading] = this.pose(frame, robot);
      const cos = Math.cos(heading), sin = Math.sin(heading), color = colors.robot[robot % COLORS], at = this.pixel([x, y]);
      const reach = Math.max(4, ...episode.footprint.map(([ahead, left, radius]) => scale * (Math.hypot(ahead, left) + radius)));
      const outcome = episode.outcomeNames[episode.outcomes.at(frame)[robot]];
      if (outcome === "collision") this.burst(context, at, reach + 8);
      else if (outcome !== "running") disc(context, at, reach + 5, null, outcome === "success" ? colors.goal : colors.ink, 2.5);
      const circles = episode.footprint.map(([ahead, left, radius]) =>
        [this.pixel([x + cos * ahead - sin * left, y + sin * ahead + cos * left]), Math.max(scale * radius, 3)]);
      circles.forEach(([centre, radius]) => disc(context, centre, radius + 1.5, colors.paper));
      circles.forEach(([centre, radius]) => disc(context, centre, radius, color));
      const nose = [[reach + 5, 0], [0.3 * reach, 0.7 * reach], [0.3 * reach, -0.7 * reach]];
      path(context, nose.map(([ahead, side]) => [at[0] + cos * ahead + sin * side, at[1] - sin * ahead + cos * side]));
      context.fillStyle = colors.ink; context.fill();
      context.strokeStyle = colors.paper; context.lineWidth = 1; context.stroke();
    }

    burst(context, [x, y], radius) {
      path(context, Array.from({ length: 20 }, (_, ray) => {
        const angle = (Math.PI * ray) / 10, reach = ray % 2 ? 0.6 * radius : radius;
        return [x + reach * Math.cos(angle), y + reach * Math.sin(angle)];
      }));
      context.fillStyle = this.colors.ink; context.fill();
      context.strokeStyle = this.colors.paper; context.lineWidth = 1.5; context.stroke();
    }
  }

  // -- The player ---------------------------------------------------------------------------------------------------------

  function made(name, text = "", attributes = {}) {
    const element = document.createElement(name);
    element.append(text);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  }

  // Shows episodes in an element, side by side; `keys` is what listens to the keyboard. Returns what a page steers it with.
  function mount(root, episodes, keys = root) {
    const labels = [...new Set(episodes.flatMap((episode) => episode.labels))];
    const step = Math.min(...episodes.map((episode) => episode.step)); // all run by one clock
    const last = Math.max(...episodes.map((episode) => Math.ceil(((episode.frames - 1) * episode.step) / step - 1e-6)));
    const shown = boxes(episodes), panes = episodes.map((episode, number) => new Pane(episode, shown[number], labels, root));
    const options = { scan: true, track: true, mind: true };
    let frame = 0, clock = 0, before = 0, isPlaying = false, timer = 0;

    const play = made("button", "play", { type: "button", class: "play" });
    const back = made("button", "\u2212", { type: "button", "aria-label": "one frame back" });
    const ahead = made("button", "+", { type: "button", "aria-label": "one frame ahead" });
    const slider = made("input", "", { type: "range", min: 0, max: last, step: 1, value: 0, "aria-label": "frame" });
    const speed = made("select", "", { "aria-label": "speed" });
    SPEEDS.forEach((times) => speed.append(made("option", times + "\u00d7", { value: times })));
    speed.value = "1";
    const clockFace = made("span", "", { class: "clock" });
    const bar = made("div", "", { class: "bar" });
    bar.append(slider, play, back, ahead, speed);
    for (const name of Object.keys(options)) {
      if (name === "mind" && labels.length === 0) continue;
      const box = made("input", "", { type: "checkbox" }), label = made("label");
      box.checked = true;
      box.addEventListener("change", () => { options[name] = box.checked; redraw(); });
      label.append(box, " " + name);
      bar.append(label);
    }
    bar.append(clockFace);
    const row = made("div", "", { class: "panes" }), legend = made("ul", "", { class: "legend", "aria-label": "legend" });
    row.append(...panes.map((pane) => pane.figure));
    root.classList.add("replay");
    root.tabIndex = 0;
    const keysTold = "keys: space plays, left and right step (with shift by ten), up and down change the speed, Home and End";
    root.replaceChildren(row, bar, legend, made("p", keysTold, { class: "keys" }));

    function redraw() {
      panes.forEach((pane) => pane.draw(Math.floor((frame * step) / pane.episode.step + 1e-6), options));
      slider.value = frame;
      clockFace.textContent = `frame ${frame} of ${last} \u00b7 ${(frame * step).toFixed(1)} s`;
      root.dataset.frame = frame;
    }

    function seek(number) {
      frame = Math.min(Math.max(number, 0), last);
      clock = frame * step;
      redraw();
    }

    function setPlaying(is) {
      if (is && frame === last) seek(0);
      isPlaying = is;
      before = performance.now();
      play.textContent = is ? "pause" : "play";
      clearTimeout(timer);
      if (is) timer = setTimeout(tick, TICK);
    }

    function tick() {
      if (!isPlaying || !root.isConnected) return;
      const now = performance.now();
      clock += (Number(speed.value) * (now - before)) / 1000;
      before = now;
      const number = Math.min(Math.floor(clock / step + 1e-9), last);
      if (number !== frame) { frame = number; redraw(); }
      if (frame === last) setPlaying(false);
      else timer = setTimeout(tick, TICK);
    }

    function changeSpeed(by) {
      speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + by, 0), SPEEDS.length - 1);
    }

    function isTaken({ target, key }) { // by what has the focus
      if (key === " ") return target.matches?.("button, select, input[type=checkbox], summary, a");
      return target.matches?.("select, input");
    }

    const actions = {
      " ": () => setPlaying(!isPlaying), ArrowUp: () => changeSpeed(1), ArrowDown: () => changeSpeed(-1),
      ArrowLeft: (by) => seek(frame - by), ArrowRight: (by) => seek(frame + by), Home: () => seek(0), End: () => seek(last),
    };
    keys.addEventListener("keydown", (event) => {
      const action = actions[event.key];
      if (!action || !root.isConnected || isTaken(event) || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      if (event.key.length > 1 && event.key !== "ArrowUp" && event.key !== "ArrowDown") setPlaying(false);
      action(event.shiftKey ? 10 : 1);
    });
    play.addEventListener("click", () => setPlaying(!isPlaying));
    back.addEventListener("click", () => { setPlaying(false); seek(frame - 1); });
    ahead.addEventListener("click", () => { setPlaying(false); seek(frame + 1); });
    slider.addEventListener("input", () => { setPlaying(false); seek(Number(slider.value)); });

    // What the marks and lines mean, drawn as they are drawn in the panes.
    function paintLegend() {
      const colors = palette(root), ratio = window.devicePixelRatio || 1, kinds = labels.map(() => new Set());
      for (const episode of episodes)
        for (const [kind, label] of episode.shapes) kinds[labels.indexOf(episode.labels[label])].add(kind);
      legend.replaceChildren(...labels.map((label, number) => {
        const sample = made("canvas", "", { width: 28 * ratio, height: 16 * ratio, "aria-hidden": "true" });
        sample.style.cssText = "width: 28px; height: 16px";
        const context = sample.getContext("2d"), style = styleOf(number, colors);
        context.setTransform(ratio, 0, 0, ratio, 0, 0);
        if (kinds[number].has(AREA)) {
          context.globalAlpha = 0.18; context.fillStyle = style.color; context.fillRect(2, 2, 24, 12); context.globalAlpha = 1;
        }
        if ([...kinds[number]].some((kind) => kind !== POINT)) {
          context.setLineDash(style.dash); context.strokeStyle = style.color; context.lineWidth = 1.75;
          if (kinds[number].has(AREA)) context.strokeRect(2, 2, 24, 12);
          else { path(context, [[1, 8], [27, 8]], false); context.stroke(); }
        }
        if (kinds[number].has(POINT)) mark(context, style.mark, [14, 8], 3.6, style.color, colors.paper);
        const item = made("li");
        item.append(sample, label.replaceAll("_", " "));
        return item;
      }));
    }

    function layOut() {
      const lines = new Set(panes.map((pane) => pane.figure.offsetTop)).size;
      panes.forEach((pane) => pane.resize(lines));
      paintLegend();
      redraw();
    }

    let width = row.clientWidth;
    const observer = new ResizeObserver(() => {
      if (row.clientWidth === width) return; // its height is what we make of it
      width = row.clientWidth;
      setTimeout(layOut); // after the observer is done: sizes that change meanwhile are an error of the page
    });
    observer.observe(row);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", layOut);
    window.addEventListener("resize", layOut);
    layOut();
    return { seek, setPlaying, pause: () => setPlaying(false) };
  }

  return { unpack, unpackAll, mount };
})();
