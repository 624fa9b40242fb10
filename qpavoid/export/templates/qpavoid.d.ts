/* Types of qpavoid.js. SI units and radians. */

/** Numbers in the memory of a module: a vector, or a matrix row by row. */
export class Block {
  readonly memory: WebAssembly.Memory;
  readonly pointer: number;
  readonly rows: number;
  readonly columns: number;
  /** The numbers, to read and write; take it anew after each call, which may move them. */
  get values(): Float64Array;
  /** Its first rows, in the same place. */
  first(rows: number): Block;
}

$types
export interface Records {
$records}

/** The functions of a module, and its memory. */
export interface Kernel extends Entries {
  readonly memory: WebAssembly.Memory;
  /** A vector of so many zeros, or of these numbers. */
  vector(given: number | ArrayLike<number>): Block;
  /** A matrix of so many rows of zeros, or of these rows. */
  matrix(given: number | number[][], columns: number): Block;
  /** A record of all its fields by name. */
  record<Name extends keyof Records>(name: Name, fields: Records[Name]): Block;
  /** Give back the memory of a block. */
  free(block: Block): void;
}

/** A kernel from the bytes, or the compiled module, of qpavoid.wasm. */
export function load(source: BufferSource | WebAssembly.Module): Promise<Kernel>;
