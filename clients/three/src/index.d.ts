import type { Group, LoadingManager, WebGLRenderer } from 'three';
import { LightControl } from 'hemibake-manifest';
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
