// A model of the reader's own, glTF or GLB: read in the browser, sent nowhere, and nothing is fetched for it.
import { Box3, BoxGeometry, EdgesGeometry, Group, LinearFilter, RepeatWrapping, Texture, Vector3 } from "three";
import { GLTFLoader, type GLTFParser } from "three/examples/jsm/loaders/GLTFLoader.js";

import type { Model } from "./models";

/** Why a file is not shown: an English sentence that the page can say in its language. */
export class ModelError extends Error {}

const MOST = 64 * 1024 * 1024;
const MAGIC = 0x46546c67; // "glTF"
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

interface Description {
  asset?: { version?: string };
  buffers?: { uri?: string; byteLength: number }[];
  bufferViews?: { buffer: number; byteOffset?: number }[];
  images?: { uri?: string; bufferView?: number; mimeType?: string }[];
  textures?: { source?: number }[];
  extensionsRequired?: string[];
}

/** Model of a file. */
export async function ownModel(file: File): Promise<Model> {
  if (file.size > MOST) throw new ModelError("The file is larger than 64 MiB. Choose a smaller model.");
  const bytes = await read(file);
  const isBinary = bytes.byteLength >= 20 && new DataView(bytes).getUint32(0, true) === MAGIC;
  const whole = isBinary ? bytes : packed(described(bytes));
  check(described(isBinary ? headOf(bytes) : bytes));
  const loader = new GLTFLoader();
  loader.register((parser) => new LocalTextures(parser) as never);
  let scene: Group;
  try {
    scene = (await loader.parseAsync(whole, "")).scene;
  } catch {
    throw new ModelError("The model cannot be read. Export it again as GLB, without compression.");
  }
  return fitted(scene);
}

function read(file: File): Promise<ArrayBuffer> {
  return new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result as ArrayBuffer);
    reader.onerror = () => failed(new ModelError("The file cannot be read. Choose it again."));
    reader.readAsArrayBuffer(file);
  });
}

/** JSON chunk of a GLB. */
function headOf(bytes: ArrayBuffer): ArrayBuffer {
  const view = new DataView(bytes);
  const size = view.getUint32(12, true);
  if (view.getUint32(16, true) !== JSON_CHUNK || 20 + size > bytes.byteLength) throw new ModelError(NOT_GLTF);
  return bytes.slice(20, 20 + size);
}

const NOT_GLTF = "The file is not a glTF model. Choose a .glb or .gltf file.";

function described(bytes: ArrayBuffer): Description {
  try {
    const found: unknown = JSON.parse(new TextDecoder().decode(bytes));
    if (typeof found === "object" && found !== null && "asset" in found) return found as Description;
  } catch {
    // Said below.
  }
  throw new ModelError(NOT_GLTF);
}

/** Refuse what would need other files or decoders. */
function check(json: Description): void {
  if (!String(json.asset?.version ?? "").startsWith("2")) throw new ModelError("The model is not of glTF 2.0. Export it as glTF 2.0.");
  const uris = [...(json.buffers ?? []), ...(json.images ?? [])].flatMap(({ uri }) => (uri === undefined ? [] : [uri]));
  if (uris.some((uri) => !uri.startsWith("data:"))) {
    throw new ModelError("The model refers to other files. Choose a .glb, which holds all of them.");
  }
  if (json.extensionsRequired?.some((name) => /draco|meshopt|basisu/i.test(name))) {
    throw new ModelError("The model is compressed. Export it without compression.");
  }
}

/** A GLB of a .gltf whose buffers are written in it: a page of this policy may not fetch even those. */
function packed(json: Description): ArrayBuffer {
  check(json);
  const parts: Uint8Array[] = [];
  let size = 0;
  const starts = (json.buffers ?? []).map(({ uri }) => {
    const part = decoded(uri ?? "");
    const start = size;
    parts.push(part);
    size += Math.ceil(part.length / 4) * 4;
    return start;
  });
  for (const view of json.bufferViews ?? []) {
    view.byteOffset = (view.byteOffset ?? 0) + (starts[view.buffer] ?? 0);
    view.buffer = 0;
  }
  json.buffers = [{ byteLength: size }];
  const text = new TextEncoder().encode(JSON.stringify(json));
  const head = Math.ceil(text.length / 4) * 4;
  const bytes = new Uint8Array(28 + head + size).fill(0x20, 20, 20 + head);
  const view = new DataView(bytes.buffer);
  [MAGIC, 2, bytes.length, head, JSON_CHUNK].forEach((word, k) => view.setUint32(4 * k, word, true));
  bytes.set(text, 20);
  view.setUint32(20 + head, size, true);
  view.setUint32(24 + head, BIN_CHUNK, true);
  parts.forEach((part, k) => bytes.set(part, 28 + head + starts[k]!));
  return bytes.buffer;
}

function decoded(uri: string): Uint8Array {
  const comma = uri.indexOf(",");
  try {
    return Uint8Array.from(atob(decodeURIComponent(uri.slice(comma + 1))), (letter) => letter.charCodeAt(0));
  } catch {
    throw new ModelError("The model cannot be read. Export it again as GLB, without compression.");
  }
}

/** Textures without an address: an address of a blob would have to be fetched, which the page's policy forbids. */
class LocalTextures {
  readonly name = "PLUMBOB_local_textures";

  constructor(private readonly parser: GLTFParser) {}

  async loadTexture(index: number): Promise<Texture | null> {
    const json = this.parser.json as Description;
    const image = json.images?.[json.textures?.[index]?.source ?? -1];
    if (!image) return null;
    const bytes =
      image.bufferView === undefined
        ? decoded(image.uri ?? "")
        : new Uint8Array((await this.parser.getDependency("bufferView", image.bufferView)) as ArrayBuffer);
    const type = image.mimeType ?? /^data:([^;,]+)/.exec(image.uri ?? "")?.[1] ?? "image/png";
    const texture = new Texture(await createImageBitmap(new Blob([bytes as BlobPart], { type }), { colorSpaceConversion: "none" }));
    texture.flipY = false;
    texture.wrapS = texture.wrapT = RepeatWrapping;
    texture.minFilter = LinearFilter;
    texture.generateMipmaps = false;
    texture.needsUpdate = true;
    return texture;
  }
}

/** Turned to forward x, left y, up z, moved to the middle, and brought to a size of about 1. */
function fitted(scene: Group): Model {
  const box = new Box3().setFromObject(scene);
  const size = box.getSize(new Vector3());
  const longest = Math.max(size.x, size.y, size.z);
  if (!(longest > 0) || !Number.isFinite(longest)) throw new ModelError("The model holds nothing that can be drawn.");
  const middle = box.getCenter(new Vector3());
  const scale = 1.6 / longest;
  scene.position.sub(middle);
  const turned = new Group();
  turned.add(scene);
  turned.scale.setScalar(scale);
  turned.rotation.set(Math.PI / 2, Math.PI / 2, 0, "XYZ"); // of glTF, forward is z, up y and left x
  const group = new Group();
  group.add(turned);
  const outline = new EdgesGeometry(new BoxGeometry(size.z * scale, size.x * scale, size.y * scale));
  return { group, outline };
}
