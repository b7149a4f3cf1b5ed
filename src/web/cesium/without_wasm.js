// without_wasm.js - in place of the packages with which Cesium reads compressed 3D models (bundle.sh): terrain has none, and
// they would compile WebAssembly when the page loads, which its content security policy forbids.
export const MeshoptDecoder = undefined, MeshoptEncoder = undefined, MeshoptSimplifier = undefined, loadSpz = undefined;
