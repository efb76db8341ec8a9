/** Linear RGB factor. */
export type Factor = [number, number, number];

/** Factors of light groups by state and group. */
export type States = Record<string, Record<string, Factor>>;

export interface Group { name: string; output: string }

/** Entry of a file in the manifest; see docs/reference/manifest.schema.json. */
export interface Entry {
  blend: string;
  scene?: string;
  export?: string;
  atlas: string;
  output: string;
  objects: { object: string; instancer?: string; persistent_id?: number[] }[];
  format: string;
  intensity: number;
  decode_texel?: string;
  decode?: string;
  shown_for?: string;
}

export interface Manifest {
  version: number;
  lightmaps: Record<string, Entry>;
  objects: object[];
  groups: Group[];
  states: States;
  probes: object[];
  reflections: object[];
}

export interface MapFile { file: string; entry: Entry }

export interface Atlas {
  light: MapFile | null;
  groups: Map<string, MapFile>;
  directional: Map<string, MapFile>;
}

export const VERSION: number;
export function readManifest(json: unknown, name?: string): { manifest: Manifest; problems: string[] };
export function readExtras(extras: unknown, name: string): { groups: Group[]; states: States; problems: string[] };
export function lightmapsOf(manifest: Manifest, file: string): { atlases: Map<string, Atlas>; atlasOf: Map<string, string> };
export function hasLight(entry: Entry): boolean;
export function decoder(entry: Entry): string;
export const MANIFEST: string;
export const decodeFunction: (decode: string, name?: string) => string;
export const mixFunction: (decodes: string[]) => string;

export interface Beside {
  atlases: Map<string, Atlas>;
  atlasOf: Map<string, string>;
  states: States;
  problems: string[];
}
/** Path of a file of the manifest as part of a URL. */
export function fileUrl(file: string): string;
export function readBeside(base: string, file: string, isOptional: boolean): Promise<Beside>;

/** Bytes of an image; its texels are decoded to irradiance / pi. */
export interface MapBytes { bytes: Uint8Array; mime: string; decode: string; intensity: number }
export function readMap(base: string, map: MapFile): Promise<MapBytes>;

export class Glb {
  constructor(buffer: ArrayBuffer);
  json: any;
  binary?: Uint8Array;
  lightmaps(): Map<number, { name: string; light: MapBytes; groups: Map<string, MapBytes> }>;
  plain(): Blob;
}

/** Lightmap whose light groups an engine mixes. */
export interface MixedLightmap {
  readonly groups: string[];
  mix(factors: Map<string, Factor>): void;
  dispose(): void;
}

/** Light of a loaded scene. */
export class LightControl {
  constructor(lightmaps: MixedLightmap[], states: States, problems: string[], others?: Iterable<string>);
  /** Messages on missing files, unknown versions and missing groups; all else is displayed. */
  readonly problems: string[];
  readonly groups: string[];
  readonly states: string[];
  setState(name: string, options?: { seconds?: number }): Promise<void>;
  setGroup(name: string, color: number[] | { r: number; g: number; b: number }, strength?: number): void;
  /** Lets states and groups change another part too, such as probe grids. */
  add(part: MixedLightmap): void;
  dispose(): void;
}
export function readRadiance(bytes: Uint8Array): { width: number; height: number; data: Float32Array };

/** Linear RGB factor of each light group, changed by states and by single groups. */
export class LightMix {
  constructor(names: Iterable<string>, states?: States, others?: Iterable<string>);
  states: States;
  factors: Map<string, Factor>;
  readonly problems: string[];
  addGroups(names: Iterable<string>): void;
  setGroup(name: string, color: number[] | { r: number; g: number; b: number }, strength?: number): void;
  setState(name: string, seconds?: number, now?: number): void;
  advance(now: number): boolean;
}

/** Maps of one lightmap. */
export interface Maps { light: MapBytes | null; groups: Map<string, MapBytes> }

export function loadLightmaps(url: string): Promise<{
  glb: Glb;
  states: States;
  problems: string[];
  sources(material: number | undefined, names: string[]): Promise<{ name: string; maps: Maps } | null>;
}>;
