"use strict";
function inflate(data) {  // deflated data with the header of zlib (RFC 1950, 1951)
  let out = new Uint8Array(4 * data.length + 512);
  let at = 0, next = 2, held = 0, count = 0;  // place in out and in data, bits that were read
  function reserve(size) {
    if (at + size <= out.length) return;
    const larger = new Uint8Array(2 * out.length + size);
    larger.set(out);
    out = larger;
  }
  function bits(n) {
    while (count < n) { held |= data[next++] << count; count += 8; }
    const value = held & ((1 << n) - 1);
    held >>>= n;
    count -= n;
    return value;
  }
  function table(lengths) {  // of a canonical Huffman code: length << 16 | symbol by the next bits
    const width = Math.max(1, ...lengths), entries = new Uint32Array(1 << width);
    let code = 0;
    for (let size = 1; size <= width; size++, code <<= 1) {
      lengths.forEach((each, symbol) => {
        if (each !== size) return;
        let reversed = 0;
        for (let k = 0; k < size; k++) reversed |= ((code >> k) & 1) << (size - 1 - k);
        for (let k = reversed; k < entries.length; k += 1 << size) entries[k] = (size << 16) | symbol;
        code++;
      });
    }
    return { width, entries };
  }
  function symbol(of) {
    while (count < of.width && next < data.length) { held |= data[next++] << count; count += 8; }
    const entry = of.entries[held & (of.entries.length - 1)];
    held >>>= entry >> 16;
    count -= entry >> 16;
    return entry & 0xffff;
  }
  const ranges = (extra, first) => extra.map((each, k) => [each, first + extra.slice(0, k).reduce((a, b) => a + (1 << b), 0)]);
  const runs = ranges([0, 0, 0, 0, 0, 0, 0, 0, ...[1, 2, 3, 4, 5].flatMap((k) => [k, k, k, k])], 3).concat([[0, 258]]);
  const distances = ranges([0, 0, ...[...Array(14).keys()].flatMap((k) => [k, k])], 1);
  const order = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
  function dynamic() {
    const literals = bits(5) + 257, far = bits(5) + 1, used = bits(4) + 4, lengths = new Array(19).fill(0);
    for (let k = 0; k < used; k++) lengths[order[k]] = bits(3);
    const code = table(lengths), all = [];
    while (all.length < literals + far) {
      const value = symbol(code);
      if (value < 16) all.push(value);
      else if (value === 16) all.push(...new Array(3 + bits(2)).fill(all[all.length - 1]));
      else all.push(...new Array(value === 17 ? 3 + bits(3) : 11 + bits(7)).fill(0));
    }
    return [table(all.slice(0, literals)), table(all.slice(literals))];
  }
  const fixed = () => [table([...Array(288).keys()].map((k) => (k < 144 ? 8 : k < 256 ? 9 : k < 280 ? 7 : 8))), table(new Array(30).fill(5))];
  for (let last = 0; !last;) {
    last = bits(1);
    const kind = bits(2);
    if (kind === 0) {  // stored
      next -= count >> 3;
      held = count = 0;
      const size = data[next] | (data[next + 1] << 8);
      reserve(size);
      out.set(data.subarray(next + 4, next + 4 + size), at);
      at += size;
      next += 4 + size;
      continue;
    }
    const [literal, distance] = kind === 1 ? fixed() : dynamic();
    for (let value = symbol(literal); value !== 256; value = symbol(literal)) {
      reserve(258);
      if (value < 256) { out[at++] = value; continue; }
      const [extra, run] = runs[value - 257], end = at + run + bits(extra);
      const [farther, back] = distances[symbol(distance)], from = back + bits(farther);
      for (; at < end; at++) out[at] = out[at - from];
    }
  }
  return out.subarray(0, at);
}
