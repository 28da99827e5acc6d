"""ro-crate-metadata.json: what lies in a report's folder, and from which program and runs, as RO-Crate 1.1 (https://w3id.org/ro/crate/1.1).

Under which licence and by whom it is published is for its author to add."""
import json
import mimetypes
from datetime import datetime, timezone

from ..grade.dataset import write_atomically

FILE = "ro-crate-metadata.json"
PROGRAM = "#testbed"


def _kind(path):
    return {".tex": "application/x-tex", ".bib": "application/x-bibtex"}.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"


def _runs(studies, purposes):
    """An action for each study: its program, its scenes' titles, when it ran."""
    for study in studies:
        own = [run.result.provenance for run in study.runs if run.result is not None]
        started = sorted(str(p["started"]) for p in own if "started" in p)
        action = {"@id": f"#study-{study.name}", "@type": "CreateAction", "name": study.spec.title or study.name,
                  "description": f"{len(study.runs)} runs", "instrument": {"@id": PROGRAM}, "result": {"@id": "./"}}
        if purposes.get(study.name):
            action["disambiguatingDescription"] = purposes[study.name]
        if started:
            action |= {"startTime": started[0], "endTime": started[-1]}
        yield action


def write_crate(out, title, studies, commits, purposes):
    """Writes out/ro-crate-metadata.json over the files that are there. `commits`: builds of the testbed that made the runs; `purposes`: of the
    studies by name, with the numbers in their words."""
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file() and path.name != FILE)
    entities = [{"@id": name, "@type": "File", "name": name.rsplit("/", 1)[-1], "encodingFormat": _kind(out / name), "contentSize": str((out / name).stat().st_size)}
                for name in files]
    actions = list(_runs(studies, purposes))
    graph = [{"@id": FILE, "@type": "CreativeWork", "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"}, "about": {"@id": "./"}},
             {"@id": "./", "@type": "Dataset", "name": title, "description": "Report of the testbed: page, figures, tables and the numbers that they were made of",
              "datePublished": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
              "hasPart": [{"@id": e["@id"]} for e in entities], "mentions": [{"@id": a["@id"]} for a in actions]},
             {"@id": PROGRAM, "@type": "SoftwareApplication", "name": "Testbed", "version": ", ".join(commits) or "unknown",
              "description": "Verification and research testbed that compares LPFDM, MPM and FEM for large soil deformation"},
             *actions, *entities]
    write_atomically(out / FILE, json.dumps({"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}, indent=1) + "\n")
