// Reads what codec.py packs: numbers in an adaptive arithmetic code, and tables whose columns are predicted.
class Decoder {
  constructor(text) {
    Object.assign(this, { text, next: 0, held: 0, bits: 0, low: 0, high: 0xffffffff, code: 0 });
    for (let k = 0; k < 4; k++) this.shift();
  }

  // The next byte of the text, in which two letters of 91 hold 13 bits.
  shift() {
    if (this.bits < 8) {
      const [first, second] = [this.next, this.next + 1].map((k) => this.text.charCodeAt(k)).map((c) => (c === 126 ? 60 : c) - 35);
      this.held = (this.held << 13) | (91 * first + second);
      this.bits += 13;
      this.next += 2;
    }
    this.bits -= 8;
    this.code = ((this.code << 8) | (this.held >> this.bits)) >>> 0;
    this.held &= (1 << this.bits) - 1;
  }

  // Chances of the bits in 32 contexts, about which nothing is known.
  model() { return { chance: new Float64Array(32 * 216).fill(0.5), seen: new Float64Array(32 * 216) }; }

  bit({ chance, seen }, slot) {
    const own = chance[slot], middle = this.low + Math.floor((this.high - this.low) * own);
    const bit = this.code <= middle ? 1 : 0;
    if (bit) this.high = middle; else this.low = middle + 1;
    seen[slot] += 1;
    chance[slot] = Math.min(Math.max(own + (bit - own) * Math.max(1 / (seen[slot] + 1.5), 0.01), 0.0005), 0.9995);
    while ((this.low ^ this.high) >>> 24 === 0) {
      this.low = (this.low << 8) >>> 0;
      this.high = ((this.high << 8) | 255) >>> 0;
      this.shift();
    }
    return bit;
  }

  number(model, context) {
    const first = 216 * context;
    let bits = 0, number = 1;
    while (this.bit(model, first + bits)) bits++;
    for (let k = 0; k < bits; k++) number = 2 * number + this.bit(model, first + 24 + 8 * bits + (number < 8 ? number : 0));
    return number & 1 ? (number - 1) / 2 : -number / 2;
  }

  numbers(count) {
    const model = this.model();
    let last = 0;
    return Array.from({ length: count }, () => (last = this.number(model, level(Math.abs(last)))));
  }

  // An array that is mostly 0: the other values by their places.
  changes() {
    const [count] = this.numbers(1), places = summed(this.numbers(count)), values = this.numbers(count);
    return new Map(places.map((place, k) => [place, values[k]]));
  }
}

// Context of a size: its number of bits and its second bit, 0 to 15.
function level(size) {
  const bits = 31 - Math.clz32(size);
  return size < 2 ? size : Math.min(2 * bits + ((size >> (bits - 1)) & 1), 15);
}

function summed(values) {
  let sum = 0;
  return values.map((value) => (sum += value));
}

// Columns of points, [axis][row], predicted from those before them and from their own previous row.
class PointColumns {
  constructor(decoder, track) {
    Object.assign(this, { decoder, rows: track.length, about: decoder.model(), columns: [] });
    this.before = track.map((own, row) => (row && track[row - 1] === own ? row - 1 : -1));
    this.misses = [new Int32Array(track.length), new Int32Array(track.length)];
  }

  know(column) { this.columns.push(column); }

  // Rows that are not kept get what is predicted.
  column(step = 1, kept = () => true) {
    const { decoder, about, before, columns } = this, model = decoder.model(), [last, older] = this.misses;
    const found = [new Float64Array(this.rows), new Float64Array(this.rows)], misses = new Int32Array(this.rows);
    const sources = [];
    let memory = 0;
    for (let count = decoder.number(about, 0); count; count--) {
      const place = decoder.number(about, 0), weight = decoder.number(about, 1);
      if (place) sources.push([columns[columns.length - place], weight]); else memory = weight;
    }
    for (let row = 0; row < this.rows; row++) {
      const old = before[row], around = last[row] + older[row] + (old < 0 ? 0 : misses[old]);
      for (let axis = 0; axis < 2; axis++) {
        let sum = old < 0 ? 512 : 512 + memory * found[axis][old];
        for (const [column, weight] of sources) sum += weight * column[axis][row];
        const code = !kept(row) ? 0 : decoder.number(model, axis ? 16 + level((around + 3 * misses[row]) >> 1) : level(around));
        found[axis][row] = Math.floor(sum / 1024) + step * code;
        misses[row] += Math.abs(code);
      }
    }
    this.misses = [misses, last];
    columns.push(found);
    return found;
  }
}
