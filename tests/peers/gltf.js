// SPDX-License-Identifier: BSD-3-Clause
// Khronos' validator's errors and warnings of glTF files, one a line; exit status 1 where a file has an error.
// usage: node gltf.js FILE...      NODE_PATH holds gltf-validator
const fs = require("fs");
const validator = require("gltf-validator");
(async () => {
    let errors = 0;
    for (const path of process.argv.slice(2)) {
        const { issues } = await validator.validateString(fs.readFileSync(path, "utf8"));
        issues.messages.filter((m) => m.severity < 2).forEach((m) => console.log(`${path}: ${m.pointer} ${m.code}: ${m.message}`));
        errors += issues.numErrors;
    }
    process.exit(errors > 0 ? 1 : 0);
})();
