//! A row of the table with its config.
//!
//! **Input** a row, and what the command line says for all. **Output** a [`Sample`], of which no file but its config was read.
//! **Steps** 1. Settings: the config's, over them those of the row, over them those of the command line. 2. Paths of the row
//! start from the table's folder, whatever config they go into. 3. The paths as they were written, by which the scan is known.
//! **Guarantees** where a folder lies says nothing of what is in it: the same table, elsewhere, has the same samples.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::table::{Row, quoted};
use super::{CohortRequest, Retry, Sample};
use crate::config::{Config, DATA_VARIABLE, Loaded, Override};
use crate::error::Error;
use crate::run;
use crate::side_file::SideFile;

const INPUT_KEY: &str = "input.path";

/// A row with its config.
pub(super) fn sample(request: &CohortRequest, row: &Row) -> Result<Sample, Error> {
    let base_dir = request.table.parent().unwrap_or(Path::new(""));
    let in_table = row.config.as_ref().map(|config| base_dir.join(config));
    let config_file = in_table.or_else(|| request.config.clone());
    let from_here = |set: &Override| Override { value: from_folder(base_dir, set), ..set.clone() };
    let mut overrides: Vec<Override> = row.settings.iter().map(from_here).collect();
    overrides.extend(request.overrides.iter().cloned());
    let path = row.settings.iter().find(|set| set.key == INPUT_KEY).map(|set| text_of(&set.value));
    let loaded = match (&config_file, path) {
        (Some(config), _) => Loaded::read_config(config, &overrides)?,
        (None, path) => Loaded::read(Path::new(&path.unwrap_or_default()), &overrides)?,
    };
    run::source_of(&loaded, request.data_dir.as_deref())?;
    Ok(Sample {
        id: row.id.clone(),
        out: request.out.join("runs").join(&row.id),
        written: written(&loaded.config, base_dir, &[&row.settings, &request.overrides]),
        loaded,
        config_file,
        retry: Retry::of(|path| words(request, &row.id, path)),
    })
}

/// The paths of a scan's files as they were written, by key: in the config, or in settings over it, the last of which has
/// the last word. One that begins at the root is taken from the folder of the data, which may be moved.
pub(crate) fn written(
    config: &Config,
    base_dir: &Path,
    settings: &[&[Override]],
) -> BTreeMap<&'static str, String> {
    let of_config = SideFile::ALL.into_iter().map(|side| (side.key(), side.path_in(config)));
    let all = of_config.chain([(INPUT_KEY, config.input.path.as_deref())]);
    let as_written = |(key, path): (&'static str, Option<&str>)| {
        let set = settings.iter().rev().find_map(|settings| settings.iter().rfind(|set| set.key == key));
        let path = set.map(|set| text_of(&set.value)).or_else(|| path.map(str::to_owned))?;
        Some((key, relative(base_dir, &path)))
    };
    all.filter_map(as_written).collect()
}

/// A path that begins at the root, from a folder; any other as it is.
fn relative(base_dir: &Path, text: &str) -> String {
    let path = Path::new(text);
    let base = Path::new(".").join(base_dir);
    let Some(base) = std::path::absolute(base).ok().filter(|_| path.is_absolute()) else {
        return text.to_owned();
    };
    let n_shared = base.components().zip(path.components()).take_while(|(a, b)| a == b).count();
    let up = base.components().skip(n_shared).map(|_| Component::ParentDir);
    let from_base: PathBuf = up.chain(path.components().skip(n_shared)).collect();
    from_base.to_string_lossy().into_owned()
}

/// The value of a setting; a path in the table is relative to the table's folder, whatever config it goes into.
fn from_folder(base_dir: &Path, set: &Override) -> String {
    let text = text_of(&set.value);
    if !is_path(set) || text.is_empty() || text.starts_with(DATA_VARIABLE) {
        return set.value.clone();
    }
    let path = base_dir.join(text);
    quoted(&std::path::absolute(&path).unwrap_or(path).to_string_lossy())
}

/// Whether a setting names a file.
pub(super) fn is_path(set: &Override) -> bool {
    set.key == INPUT_KEY || SideFile::ALL.iter().any(|side| side.key() == set.key)
}

/// The text in a TOML string; of what is none, as it is.
pub(super) fn text_of(value: &str) -> String {
    let table = toml::from_str::<toml::Table>(&format!("value = {value}")).ok();
    let text = table.as_ref().and_then(|table| table.get("value")?.as_str());
    text.unwrap_or(value).to_owned()
}

/// The command that does a scan alone.
fn words(request: &CohortRequest, id: &str, path: &dyn Fn(&Path) -> String) -> Vec<String> {
    let file = |file: &Path| Retry::word(&path(file));
    let mut words = vec!["espalier cohort".to_owned(), file(&request.table)];
    words.push(format!("-o {}", file(&request.out)));
    words.extend(request.config.iter().map(|config| format!("--config {}", file(config))));
    words.extend(Retry::settings(&request.overrides, path));
    words.extend(Retry::options(&request.options, path));
    words.push(format!("--only {id}"));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_from_the_root_is_known_by_its_way_from_the_data() {
        let seen = |base: &str, path: &str| relative(Path::new(base), path);
        assert_eq!(seen("/a/study", "/a/study/names.txt"), "names.txt");
        assert_eq!(seen("/b/c/study", "/b/c/other/names.txt"), "../other/names.txt");
        assert_eq!(seen("/a/study", "names.txt"), "names.txt");
        let here = std::path::absolute("names.txt").expect("a folder");
        assert_eq!(seen("", &here.to_string_lossy()), "names.txt");
    }
}
