//! The settings that the results in a run folder were made with: `provenance/config.resolved.toml`.
//!
//! Each stage brings its own table along when its results are written, so the file speaks of what is there, also
//! after a run that began in the middle, ended early, or failed.

use std::collections::BTreeMap;

use toml::{Table, Value};

use crate::config::{Config, UNNAMED};
use crate::error::Error;
use crate::event::Setting;
use crate::folder::RunFolder;
use crate::side_file::SideFile;
use crate::stage::Stage;

/// Where they stand.
pub(crate) const FILE: &str = "provenance/config.resolved.toml";

/// What identifies a run as a whole: with another of these, no earlier result is of the same run.
const IDENTITY: [&str; 3] = ["schema", "seed", "input"];

/// The settings of a run folder, those it has and those of the run that is under way.
pub(crate) struct Settings {
    kept: Option<Table>,
    /// Whether they were altered, or left by a run that was killed: then no setting agrees with them.
    is_altered: bool,
    wanted: Table,
}

/// A setting that earlier results were not made with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The dotted key.
    pub key: String,
    /// Its value when the results were made.
    pub kept: String,
    /// Its value now.
    pub wanted: String,
    /// The stage whose results would have to be made again.
    pub stage: Stage,
}

impl Settings {
    /// The settings of a folder about to see a run of `config`.
    pub(crate) fn open(folder: &RunFolder, config: &Config) -> Self {
        let parsed = |bytes| toml::from_str(&String::from_utf8(bytes).ok()?).ok();
        let read = folder.read(FILE);
        let is_altered = matches!(read, Err(Error::Altered { .. }));
        Self { kept: read.ok().and_then(parsed), is_altered, wanted: portable(config) }
    }

    /// Whether the folder's results are of another run: another input, another seed.
    pub(crate) fn is_other_run(&self) -> bool {
        let differs = |kept: &Table| IDENTITY.iter().any(|key| kept.get(*key) != self.wanted.get(*key));
        self.is_altered || self.kept.as_ref().is_some_and(differs)
    }

    /// The first setting that the results of `earlier` stages were not made with; `first` is the run's first stage.
    pub(crate) fn difference(&self, earlier: &[Stage], first: Stage) -> Option<Difference> {
        let nothing = self.is_altered.then(Table::new);
        let kept = nothing.as_ref().or(self.kept.as_ref())?;
        let identity = IDENTITY.iter().map(|key| (*key, first));
        let tables = earlier.iter().map(|stage| (stage.name(), *stage));
        identity.chain(tables).find_map(|(key, stage)| {
            let (name, kept, wanted) = first_difference(key, kept.get(key), self.wanted.get(key))?;
            Some(Difference { key: name, kept, wanted, stage })
        })
    }

    /// The settings that a stage's results depend on, by dotted key.
    pub(crate) fn of(&self, stage: Stage) -> BTreeMap<String, String> {
        let mut all = BTreeMap::new();
        flatten("", &self.wanted, &mut all);
        all.retain(|key, _| concerns(stage, key));
        all
    }

    /// Takes over the settings of a stage whose results have just been made, and writes the file.
    pub(crate) fn adopt(&mut self, folder: &mut RunFolder, stage: Stage) -> Result<(), Error> {
        let wanted = &self.wanted;
        let kept = self.kept.get_or_insert_with(|| wanted.clone());
        for key in IDENTITY.into_iter().chain(["name", stage.name()]) {
            match wanted.get(key) {
                Some(value) => _ = kept.insert(key.to_owned(), value.clone()),
                None => _ = kept.remove(key),
            }
        }
        // Plain tables: serialisation cannot fail. They are sorted by key, however they were put together.
        folder.write(FILE, toml::to_string(kept).unwrap_or_default().as_bytes())
    }
}

/// A config as a text that is the same for equal settings, on any machine.
pub(crate) fn portable_text(config: &Config) -> String {
    toml::to_string(&portable(config)).unwrap_or_default()
}

/// Whether a stage's results depend on a setting.
fn concerns(stage: Stage, key: &str) -> bool {
    let table = key.split('.').next().unwrap_or_default();
    let is_shared = match stage {
        // The page lists them all.
        Stage::Report => true,
        Stage::Phantom => matches!(table, "input" | "seed"),
        // How masks and traced trees are read.
        Stage::Volume | Stage::Skeleton | Stage::Radius | Stage::Tree => {
            table == "input" || key == "volume.orientation"
        }
        Stage::Views | Stage::Embed => table == "seed",
        // The map may show the scan, which is read as the input says; the figure in space shows the mask.
        Stage::Render => matches!(table, "name" | "input") || key == "volume.orientation",
    };
    is_shared || table == "schema" || table == stage.name()
}

/// Every setting of a run as a dotted key with its value, and the value that it has when nobody says; of files only that
/// there is one.
pub(crate) fn listed(config: &Config, stages: &[Stage]) -> Vec<(String, String, Option<String>)> {
    let mut config = config.clone();
    let hidden = |path: &mut Option<String>| {
        *path = path.take().filter(|path| !path.is_empty()).map(|_| "(a file)".to_owned());
    };
    hidden(&mut config.input.path);
    SideFile::ALL.into_iter().for_each(|side| hidden(side.slot(&mut config)));
    let is_shown = |key: &str| {
        let table = key.split('.').next().unwrap_or_default();
        table == "input" || stages.iter().any(|stage| stage.name() == table)
    };
    let mut defaults = flat(&Config::default().to_toml());
    let mut listed: Vec<_> = flat(&config.to_toml())
        .into_iter()
        .map(|(key, value)| {
            let default = defaults.remove(&key);
            (key, value, default)
        })
        .collect();
    listed.extend(defaults.into_iter().map(|(key, default)| (key, "not set".to_owned(), Some(default))));
    listed.retain(|(key, ..)| is_shown(key));
    listed
}

/// The settings of a run that are not at their default.
pub(crate) fn changed(config: &Config, stages: &[Stage]) -> Vec<Setting> {
    let seed = (config.seed != 0).then(|| ("seed".to_owned(), config.seed.to_string(), Some("0".to_owned())));
    let all = seed.into_iter().chain(listed(config, stages));
    let changed = all.filter(|(_, value, default)| default.as_ref() != Some(value));
    changed.map(|(key, value, default)| Setting { key, value, default }).collect()
}

/// Every setting in the text of a resolved config, by dotted key; none where it is no TOML.
pub(crate) fn flat(text: &str) -> BTreeMap<String, String> {
    let mut keys = BTreeMap::new();
    flatten("", &toml::from_str(text).unwrap_or_default(), &mut keys);
    keys
}

/// The values of a table and of those in it, by dotted key.
fn flatten(prefix: &str, table: &Table, keys: &mut BTreeMap<String, String>) {
    // The depth is that of our own structs.
    for (key, value) in table {
        let key = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Table(inner) => flatten(&key, inner, keys),
            value => _ = keys.insert(key, value.to_string()),
        }
    }
}

/// The config without what is of this machine or of a patient: of the paths of files only what kind of file they are,
/// and no name that is only the input's. What the files hold, `provenance/inputs.tsv` tells by its digest.
fn portable(config: &Config) -> Table {
    let mut portable = config.clone();
    config.own_name().unwrap_or(UNNAMED).clone_into(&mut portable.name);
    let kind_alone = |path: &mut Option<String>, role: &str| {
        *path = path.take().filter(|path| !path.is_empty()).map(|path| format!("{role}{}", extension(&path)));
    };
    kind_alone(&mut portable.input.path, "input");
    SideFile::ALL.into_iter().for_each(|side| kind_alone(side.slot(&mut portable), side.role()));
    toml::from_str(&portable.to_toml()).unwrap_or_default()
}

/// The end of a file's name that says what kind it is, with its dot; nothing where it is none that is known, since it may
/// be a part of a name.
fn extension(path: &str) -> &'static str {
    const KNOWN: [&str; 17] = [
        ".nii.gz", ".nii", ".hdr", ".img", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm", ".swc", ".vtp", ".vtk",
        ".json", ".tsv", ".csv", ".txt", ".ctbl",
    ];
    let path = path.to_ascii_lowercase();
    KNOWN.into_iter().find(|end| path.ends_with(end)).unwrap_or_default()
}

/// The first key at which two values differ, with both of them as text.
fn first_difference(
    key: &str,
    kept: Option<&Value>,
    wanted: Option<&Value>,
) -> Option<(String, String, String)> {
    if kept == wanted {
        return None;
    }
    if let (Some(Value::Table(kept)), Some(Value::Table(wanted))) = (kept, wanted) {
        return wanted.keys().chain(kept.keys()).find_map(|inner| {
            first_difference(&format!("{key}.{inner}"), kept.get(inner), wanted.get(inner))
        });
    }
    let text = |value: Option<&Value>| value.map_or_else(|| "not set".to_owned(), ToString::to_string);
    Some((key.to_owned(), text(kept), text(wanted)))
}
