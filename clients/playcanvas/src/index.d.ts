import type { AppBase, Asset, Entity } from 'playcanvas';
import { LightControl } from 'hemibake-manifest';

export class HemibakeLoader {
  constructor(app: AppBase);
  /** Rejects only if the .glb file itself cannot be read; other faults are in `problems`. */
  load(url: string): Promise<LightmappedScene>;
}

export class LightmappedScene extends LightControl {
  readonly asset: Asset;
  /** Root of the file; add it to the scene. */
  readonly entity: Entity;
}
