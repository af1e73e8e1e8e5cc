/** The part of Draco's decoder that we use (draco3d 1.5.9, WebIDL bindings). */
declare module "draco3d/draco_decoder_nodejs.js" {
  export interface DracoStatus {
    ok(): boolean;
    error_msg(): string;
  }
  export interface DracoAttribute {
    attribute_type(): number;
    data_type(): number;
    num_components(): number;
  }
  export interface DracoMesh {
    num_faces(): number;
    num_points(): number;
    num_attributes(): number;
  }
  export interface DracoDecoder {
    DecodeArrayToMesh(bytes: Int8Array, size: number, mesh: DracoMesh): DracoStatus;
    GetAttribute(mesh: DracoMesh, index: number): DracoAttribute;
    GetTrianglesUInt32Array(mesh: DracoMesh, bytes: number, to: number): boolean;
    GetAttributeDataArrayForAllPoints(
      mesh: DracoMesh, attribute: DracoAttribute, type: number, bytes: number, to: number,
    ): boolean;
  }
  export interface DracoModule {
    readonly HEAPU8: Uint8Array<ArrayBuffer>;
    readonly POSITION: number;
    readonly COLOR: number;
    readonly GENERIC: number;
    readonly DT_UINT8: number;
    readonly DT_FLOAT32: number;
    Decoder: new () => DracoDecoder;
    Mesh: new () => DracoMesh;
    _malloc(bytes: number): number;
    _free(at: number): void;
    destroy(object: DracoDecoder | DracoMesh | DracoStatus): void;
  }
  export default function createDecoder(options: { wasmBinary?: ArrayBuffer }): Promise<DracoModule>;
}
