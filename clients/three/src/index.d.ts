import type { Group, LoadingManager, WebGLRenderer } from 'three';
import { LightControl } from 'hemibake-manifest';
import type { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';

export interface HemibakeLoaderOptions {
  /** 'inside' prefers the lightmaps in the file, 'beside' the files of hemibake.json. */
  maps?: 'inside' | 'beside';
  manager?: LoadingManager;
}

export class HemibakeLoader {
  constructor(renderer: WebGLRenderer, options?: HemibakeLoaderOptions);
  /** Rejects only if the glTF file itself cannot be read; other faults are in `problems`. */
  load(url: string): Promise<LightmappedScene>;
}

export class LightmappedScene extends LightControl {
  readonly gltf: GLTF;
  readonly scene: Group;
}

/** Light probe volumes of a hemibake.json as grids to add to a scene. Rejects if the manifest cannot be read. */
export function loadProbeGrids(url: string): Promise<{ grids: LightProbeGridWebGL[]; problems: string[] }>;
