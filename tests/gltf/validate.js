// SPDX-License-Identifier: Apache-2.0
// Holds GLB files to the glTF 2.0 specification by the Khronos Group's validator: no error and no warning.
// Usage: node validate.js FILE...
const { readFileSync } = require('fs');
const validator = require('gltf-validator');

async function main() {
  let failed = false;
  for (const path of process.argv.slice(2)) {
    const { issues, info } = await validator.validateBytes(new Uint8Array(readFileSync(path)), { maxIssues: 20 });
    console.log(`${path}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${info.totalTriangleCount} triangles`);
    for (const issue of issues.messages.filter((message) => message.severity < 2)) console.log(JSON.stringify(issue));
    failed ||= issues.numErrors > 0 || issues.numWarnings > 0;
  }
  if (failed) process.exitCode = 1;
}

main();
