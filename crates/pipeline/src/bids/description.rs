//! What a BIDS data set says of itself: `dataset_description.json`.
//!
//! **Input** that of the data set that is read. **Output** that of ours, a derivative, with `.bidsignore` beside it.
//! **Guarantees** a description that another program wrote is never overwritten; ours has no path, time or host.
//! **Source** Brain Imaging Data Structure [Gorgolewski2016], version 1.10.0 of the specification, "Modality agnostic files" and "Derivatives".

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::error::Error;
use crate::folder::write_file;

const FILE: &str = "dataset_description.json";
const BIDS_VERSION: &str = "1.10.0";
const PROGRAM: &str = "espalier";
/// Run folders, page and list are no files of BIDS.
const IGNORED: &str = "sub-*/\ngroup/\nfailures.tsv\n";
/// The longest description that is read, in bytes.
const MAX_BYTES: u64 = 4 << 20;

/// Checks that a folder describes itself as BIDS has it.
pub(super) fn check(root: &Path) -> Result<(), Error> {
    fs::read_dir(root).map_err(|source| Error::Read { path: root.to_owned(), source })?;
    let path = root.join(FILE);
    let refused = |problem: &str| Error::BidsDataset { path: path.clone(), problem: problem.to_owned() };
    if !path.is_file() {
        return Err(refused("there is no such file"));
    }
    let description = read(&path).ok_or_else(|| refused("it is no JSON"))?;
    for key in ["Name", "BIDSVersion"] {
        if !description.get(key).is_some_and(Value::is_string) {
            return Err(refused(&format!("it has no {key}")));
        }
    }
    Ok(())
}

/// Writes the description of our results, made from the data set in `root`.
pub(super) fn write(root: &Path, out: &Path) -> Result<(), Error> {
    let place = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).ok();
    let is_subject = |below: &Path| below.to_string_lossy().starts_with("sub-");
    // Results among the scans of a subject would be taken for scans.
    let is_own_input = place(out).zip(place(root)).is_some_and(|(out, root)| {
        out.strip_prefix(root).is_ok_and(|below| below.as_os_str().is_empty() || is_subject(below))
    });
    let path = out.join(FILE);
    if is_own_input || path.exists() && !read(&path).is_some_and(|description| is_ours(&description)) {
        return Err(Error::BidsOutput { folder: out.to_owned() });
    }
    let mut description = json!({
        "Name": "Trees laid flat by espalier",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [{
            "Name": PROGRAM,
            "Version": env!("CARGO_PKG_VERSION"),
            "Description": "scan, mask or label map to a tree, and the tree to one planar picture without crossings",
        }],
    });
    let source = read(&root.join(FILE)).and_then(|source| source.get("DatasetDOI").cloned());
    if let (Some(doi), Some(object)) = (source.filter(Value::is_string), description.as_object_mut()) {
        object.insert("SourceDatasets".to_owned(), json!([{ "DOI": doi }]));
    }
    let text = serde_json::to_string_pretty(&description).unwrap_or_default() + "\n";
    write_file(&path, text.as_bytes())?;
    write_file(&out.join(".bidsignore"), IGNORED.as_bytes())
}

fn is_ours(description: &Value) -> bool {
    let by = description.get("GeneratedBy").and_then(Value::as_array);
    by.is_some_and(|by| by.iter().any(|by| by.get("Name").and_then(Value::as_str) == Some(PROGRAM)))
}

fn read(path: &Path) -> Option<Value> {
    let is_short = fs::metadata(path).ok()?.len() <= MAX_BYTES;
    let text = is_short.then(|| fs::read_to_string(path).ok())??;
    serde_json::from_str(text.strip_prefix('\u{feff}').unwrap_or(&text)).ok()
}
