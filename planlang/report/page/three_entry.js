// The parts of three.js that scene.js uses. To build three.js.gz, run in an empty folder:
//
//   npm install three@0.187.0 esbuild@0.28.2
//   cp .../planlang/report/page/three_entry.js .
//   npx esbuild three_entry.js --bundle --minify --format=iife --global-name=THREE --target=es2022 \
//       --legal-comments=none --outfile=three.js
//   gzip -9n three.js
//
// LICENSE.three.txt is three.js' own; NOTICE names its version.

export {
  Box3, BoxGeometry, BufferAttribute, BufferGeometry, CircleGeometry, Color, CylinderGeometry, DirectionalLight, Group,
  HemisphereLight, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, PCFShadowMap, PerspectiveCamera, PlaneGeometry, Quaternion, Raycaster, RingGeometry, Scene,
  SphereGeometry, SRGBColorSpace, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
