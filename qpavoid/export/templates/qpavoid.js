/* Machine code of qpavoid for JavaScript. SI units and radians; see qpavoid.d.ts.
 *
 *   const q = await load(bytes);
 *   const [v, omega] = q.kanayama([0.1, 0.0, 0.2], [0.5, 0.0], [1.0, 1.0, 2.0]);
 *
 * Of every entry there is a method. Numbers are numbers; arrays and records are blocks
 * of the module's memory, made by `vector`, `matrix` and `record`; tuples are arrays, or
 * objects where their parts have names. */

export const TABLE = $table;

const NUMBERS = { double: Number, int: Math.trunc, bool: Number };
const SIZES = { vector: 1, matrix: 2 };

/** Numbers in the memory of a module: a vector, or a matrix row by row. */
export class Block {
  constructor(memory, pointer, rows, columns) {
    Object.assign(this, { memory, pointer, rows, columns });
  }

  /** The numbers, to read and write; take it anew after each call, which may move them. */
  get values() {
    const count = this.rows * this.columns;
    return new Float64Array(this.memory.buffer, this.pointer, count);
  }

  /** Its first rows, in the same place. */
  first(rows) {
    if (!(rows >= 0 && rows <= this.rows)) throw new RangeError(`$${rows} rows of $${this.rows}`);
    return new Block(this.memory, this.pointer, rows, this.columns);
  }
}

/** The functions of a module, its memory, and what they want to know. */
export class Kernel {
  #native;
  #result;

  constructor(native) {
    this.#native = native;
    this.memory = native.memory;
    native._initialize();
    this.#result = this.vector(128);
    for (const [name, entry] of Object.entries(TABLE.entries)) {
      this[name] = (...given) => this.#call(name, entry, given);
    }
  }

  #allocate(bytes) {
    const pointer = this.#native.malloc(Math.max(bytes, 8));
    if (!pointer) throw new RangeError(`no memory for $${bytes} bytes`);
    return pointer;
  }

  /** A vector of so many zeros, or of these numbers. */
  vector(given) {
    const values = typeof given === "number" ? new Float64Array(given) : given;
    const block = new Block(this.memory, this.#allocate(8 * values.length), values.length, 1);
    block.values.set(values);
    return block;
  }

  /** A matrix of so many rows of zeros, or of these rows. */
  matrix(given, columns) {
    const rows = typeof given === "number" ? given : given.length;
    const block = new Block(this.memory, this.#allocate(8 * rows * columns), rows, columns);
    block.values.set(typeof given === "number" ? new Float64Array(rows * columns) : given.flat());
    return block;
  }

  /** A record, such as "filter_settings", of all its fields by name. */
  record(name, fields) {
    const { size, fields: known } = TABLE.records[name];
    const block = new Block(this.memory, this.#allocate(size), size / 8, 1);
    const view = new DataView(this.memory.buffer, block.pointer, size);
    for (const [field, { offset, kind }] of Object.entries(known)) {
      if (!(field in fields)) throw new TypeError(`$${name} wants $${field}`);
      if (kind === "double") view.setFloat64(offset, fields[field], true);
      else view.setBigInt64(offset, BigInt(fields[field]), true);
    }
    return Object.assign(block, { kind: name });
  }

  /** Give back the memory of a block. */
  free(block) {
    this.#native.free(block.pointer);
  }

  #call(name, entry, given) {
    if (given.length !== entry.arguments.length) {
      throw new TypeError(`$${name} takes $${entry.arguments.length} arguments, not $${given.length}`);
    }
    const flat = [];
    entry.arguments.forEach((shape, i) => this.#flatten(shape, given[i], flat));
    const call = this.#native[`qpavoid_$${name}`], { kind } = entry.result;
    if (kind !== "tuple") {
      const number = call(...flat);
      return kind === "bool" ? Boolean(number) : number;
    }
    call(...flat, this.#result.pointer);
    return this.#unpack(entry.result, this.#result.values, { at: 0 });
  }

  #flatten(shape, value, flat) {
    const { name, kind, parts, fields } = shape;
    if (kind in NUMBERS) {
      if (typeof value !== "number" && typeof value !== "boolean") {
        throw new TypeError(`$${name} must be a number`);
      }
      flat.push(NUMBERS[kind](value));
    } else if (kind === "tuple") {
      const names = fields.length ? fields : parts.map((_, i) => i);
      parts.forEach((part, i) => this.#flatten(part, value[names[i]], flat));
    } else if (!(value instanceof Block) || value.memory !== this.memory) {
      throw new TypeError(`$${name} must be a block of this kernel`);
    } else if (kind in SIZES) {
      flat.push(value.pointer, ...[value.rows, value.columns].slice(0, SIZES[kind]));
    } else if (value.kind !== kind) {
      throw new TypeError(`$${name} must be a record $${kind}`);
    } else {
      flat.push(value.pointer);
    }
  }

  #unpack(shape, values, place) {
    if (shape.kind !== "tuple") {
      const number = values[place.at++];
      return shape.kind === "bool" ? number !== 0 : number;
    }
    const parts = shape.parts.map((part) => this.#unpack(part, values, place));
    if (!shape.fields.length) return parts;
    return Object.fromEntries(shape.fields.map((field, i) => [field, parts[i]]));
  }
}

/** A kernel from the bytes, or the compiled module, of qpavoid.wasm. */
export async function load(source) {
  const made = await WebAssembly.instantiate(source, {});
  return new Kernel((made.instance ?? made).exports);
}
