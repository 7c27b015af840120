// What the network sees of one person, heading up: obstacle grid and angular pedestrian grid.
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Fits a canvas to its place on the page and gives a brush in CSS pixels.
function brushOf(canvas) {
  const { width, height } = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const brush = canvas.getContext("2d");
  brush.scale(ratio, ratio);
  return { brush, width, height };
}

function drawPerson(brush, x, y, radius) {
  brush.fillStyle = ink("near");
  brush.beginPath();
  brush.moveTo(x, y - 1.9 * radius);
  brush.lineTo(x + radius, y + radius);
  brush.lineTo(x - radius, y + radius);
  brush.closePath();
  Object.assign(brush, { strokeStyle: ink("paper"), lineWidth: 2 }); // seen on obstacles, too
  brush.stroke();
  brush.fill();
}

function drawGrid(canvas, replay, row) {
  const { brush, width } = brushOf(canvas);
  brush.fillStyle = ink("paper");
  brush.fillRect(0, 0, width, width);
  brush.strokeStyle = ink("rule");
  brush.strokeRect(0.5, 0.5, width - 1, width - 1);
  if (row === undefined) return;
  brush.imageSmoothingEnabled = false;
  brush.drawImage(replay.gridPicture(row, ink("obstacle")), 0, 0, width, width);
  drawPerson(brush, width / 2, width / 2, 4);
}

function drawAngular(canvas, replay, row) {
  const { brush, width } = brushOf(canvas), middle = width / 2, outer = middle - 2;
  brush.fillStyle = ink("paper");
  brush.strokeStyle = ink("rule");
  for (const part of [1, 2 / 3, 1 / 3]) {
    brush.beginPath();
    brush.arc(middle, middle, outer * part, 0, 2 * Math.PI);
    if (part === 1) brush.fill();
    brush.stroke();
  }
  if (row === undefined) return;
  const cones = replay.cones(row), wide = (2 * Math.PI) / cones.length, range = replay.header.range_m;
  brush.strokeStyle = ink("near");
  brush.lineWidth = 4;
  cones.forEach((distance, k) => {
    if (distance >= range) return;
    const begin = -Math.PI / 2 - k * wide; // up is ahead, counter-clockwise is left
    brush.beginPath();
    brush.arc(middle, middle, (outer * distance) / range, begin - wide, begin);
    brush.stroke();
  });
  drawPerson(brush, middle, middle, 4);
}
