import type { AbstractMesh } from '@babylonjs/core/Meshes/abstractMesh.js';
import type { ISceneLoaderAsyncResult } from '@babylonjs/core/Loading/sceneLoader.js';
import type { Scene } from '@babylonjs/core/scene.js';
import { LightControl } from 'hemibake-manifest';

export class HemibakeLoader {
  constructor(scene: Scene);
  /** Rejects only if the .glb file itself cannot be read; other faults are in `problems`. */
  load(url: string): Promise<LightmappedScene>;
}

export class LightmappedScene extends LightControl {
  readonly loaded: ISceneLoaderAsyncResult;
  readonly meshes: AbstractMesh[];
}
