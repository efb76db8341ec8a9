// Radiance HDR files (Ward 1991), as Hemibake writes them: rows from the top, RGBE, run-length encoded or flat.

/** Returns { width, height, data } of a Radiance HDR file: Float32Array of RGBA, first row at the top. */
export function readRadiance(bytes) {
  const lines = new Lines(bytes);
  if (!lines.next().startsWith('#?')) throw new Error('not a Radiance HDR file');
  while (lines.next() !== '');
  const size = /^-Y (\d+) \+X (\d+)$/.exec(lines.next());
  if (size === null) throw new Error('rows of a Radiance HDR file have to go from the top, as -Y height +X width');
  const height = Number(size[1]), width = Number(size[2]);
  const data = new Float32Array(4 * width * height), row = new Uint8Array(4 * width);
  let at = lines.at;
  for (let y = 0; y < height; y++) {
    at = readRow(bytes, at, width, row);
    for (let x = 0; x < width; x++) {
      const scale = row[4 * x + 3] === 0 ? 0 : 2 ** (row[4 * x + 3] - 136), to = 4 * (y * width + x);
      for (let c = 0; c < 3; c++) data[to + c] = row[4 * x + c] * scale;
      data[to + 3] = 1;
    }
  }
  return { width, height, data };
}

class Lines {
  constructor(bytes) { this.bytes = bytes; this.at = 0; }

  next() {
    const end = this.bytes.indexOf(10, this.at);
    if (end < 0) throw new Error('a Radiance HDR file ends within its header');
    const line = String.fromCharCode(...this.bytes.subarray(this.at, end));
    this.at = end + 1;
    return line;
  }
}

// Fills a row of RGBE texels and returns the place after it.
function readRow(bytes, at, width, row) {
  const isPacked = bytes[at] === 2 && bytes[at + 1] === 2 && bytes[at + 2] * 256 + bytes[at + 3] === width;
  if (!isPacked || width < 8 || width > 32767) {
    row.set(bytes.subarray(at, at + 4 * width));
    return at + 4 * width;
  }
  at += 4;
  for (let c = 0; c < 4; c++) {
    for (let x = 0; x < width;) {
      const count = bytes[at++];
      if (!(count > 0)) throw new Error('a Radiance HDR file ends within its rows');
      if (count > 128) {
        for (let i = 0; i < count - 128; i++) row[4 * x++ + c] = bytes[at];
        at++;
      } else {
        for (let i = 0; i < count; i++) row[4 * x++ + c] = bytes[at++];
      }
    }
  }
  return at;
}
