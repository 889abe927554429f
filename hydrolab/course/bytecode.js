// Writes an archive of the bytecode of every installed module that some statements import, made by
// the Python that will run it: node bytecode.js CORE DISTRIBUTION PACKAGES STATEMENTS ARCHIVE
"use strict";

const COMPILE = `
import pathlib, py_compile, site, sys, zipfile
(root,) = map(pathlib.Path, site.getsitepackages())
mode = py_compile.PycInvalidationMode.UNCHECKED_HASH
with zipfile.ZipFile("/bytecode.zip", "w") as archive:
    for module in list(sys.modules.values()):
        source = pathlib.Path(getattr(module, "__file__", None) or "")
        if source.suffix == ".py" and source.is_relative_to(root):
            made = py_compile.compile(str(source), doraise=True, invalidation_mode=mode)
            archive.write(made, source.relative_to(root))
`;

async function main(core, folder, packages, statements, archive) {
  const { loadPyodide } = await import(`${core}/pyodide.mjs`);
  const python = await loadPyodide({ indexURL: `${folder}/` });
  await python.loadPackage(packages.split(" "), { messageCallback: () => {} });
  python.runPython(statements);
  python.runPython(COMPILE);
  require("node:fs").writeFileSync(archive, python.FS.readFile("/bytecode.zip"));
}

main(...process.argv.slice(2)).catch(error => {
  console.error(String(error.message).slice(-2000));
  process.exitCode = 1;
});
