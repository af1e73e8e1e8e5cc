// node validate_gltf.mjs FILE.glb: the Khronos validator's verdict in one line; exit code 1 on any
// error. Warnings and errors are listed on stderr.
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import validator from 'gltf-validator';

const file = process.argv[2];
if (!file) {
  console.error('usage: node validate_gltf.mjs FILE.glb');
  process.exit(2);
}

try {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    uri: basename(file),
    maxIssues: 0,
  });
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  for (const { severity, code, pointer, message } of messages)
    if (severity <= 1)
      console.error(`${severity === 0 ? 'error' : 'warning'} ${code} ${pointer ?? ''}: ${message}`);
  const { drawCallCount = 0, totalTriangleCount = 0, totalVertexCount = 0 } = report.info ?? {};
  console.log(
    `${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos; ` +
      `${drawCallCount} primitives, ${totalTriangleCount} triangles, ${totalVertexCount} vertices`,
  );
  process.exit(numErrors > 0 ? 1 : 0);
} catch (error) {
  console.error(`${file}: ${error.message ?? error}`);
  process.exit(1);
}
