//! The config: one TOML file is the whole run.
//!
//! **Steps** 1. Parse the text; an unknown key or a wrong type is an error at its line. 2. Lay `--set key=value`
//! overrides over it; a preset settles what neither says. 3. Validate every stage's parameters; a value out of range is an error at its line.
//! 4. [`Config::to_toml`] writes the resolved copy, every key with its value.
//!
//! What can be known of a key ([`keys`]), the JSON Schema ([`schema`]) and configs to start with ([`Template`]) are made from
//! the same types.

mod input;
mod keys;
mod place;
mod ranges;
mod schema;
mod template;
mod words;

use std::path::{Path, PathBuf};

use espalier_model::diagnose::{Class, Diagnose, ParamError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use input::DATA_VARIABLE;
pub use input::{Input, InputKind, Source, Unit};
pub use keys::{Key, explain_keys, keys};
pub use schema::{schema, schema_text};
pub use template::Template;

use crate::error::Error;
use crate::stage::Stage;

/// The version of the config's schema.
pub const SCHEMA: u32 = 1;

/// A whole run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The version of the schema; 1.
    pub schema: u32,
    /// The name of the run: its folder is `out/<name>`, its title that of the picture.
    pub name: String,
    /// The seed of everything random in the run. Default 0; always saved.
    pub seed: u64,
    /// Where the run begins.
    pub input: Input,
    /// `[phantom]`: the shape and the scan of a phantom.
    pub phantom: espalier_phantom::Params,
    /// `[volume]`: scan → mask.
    pub volume: espalier_volume::Params,
    /// `[skeleton]`: mask → curve skeleton.
    pub skeleton: espalier_skeleton::Params,
    /// `[radius]`: inscribed spheres.
    pub radius: espalier_radius::Params,
    /// `[tree]`: one rooted tree.
    pub tree: espalier_tree::Params,
    /// `[views]`: views and local planes.
    pub views: espalier_views::Params,
    /// `[embed]`: the planar embedding.
    pub embed: espalier_embed::Params,
    /// `[render]`: pictures.
    pub render: espalier_render::Params,
    /// `[report]`: the page of the run.
    pub report: espalier_report::Params,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            schema: SCHEMA,
            name: "run".to_owned(),
            seed: 0,
            input: Input::default(),
            phantom: espalier_phantom::Params::default(),
            volume: espalier_volume::Params::default(),
            skeleton: espalier_skeleton::Params::default(),
            radius: espalier_radius::Params::default(),
            tree: espalier_tree::Params::default(),
            views: espalier_views::Params::default(),
            embed: espalier_embed::Params::default(),
            render: espalier_render::Params::default(),
            report: espalier_report::Params::default(),
        }
    }
}

/// The name in every result of a run that nobody has named.
pub(crate) const UNNAMED: &str = "run";

/// What stands for the name of a config that is only on the command line.
const COMMAND_LINE: &str = "command line";

/// No config is as large: the longest resolved ones have some kilobytes.
const MAX_CONFIG_BYTES: u64 = 4 << 20;

/// A config and the folder that its relative paths start from.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The config.
    pub config: Config,
    /// Relative paths in it start here.
    pub base_dir: PathBuf,
}

impl Loaded {
    /// A config file (.toml), or an input with every setting at its default, under `overrides`.
    ///
    /// # Errors
    /// [`Error`] if the file cannot be read or a setting is wrong.
    pub fn read(path: &Path, overrides: &[Override]) -> Result<Self, Error> {
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml")) {
            return Ok(Self { config: Config::for_input(path, overrides)?, base_dir: PathBuf::new() });
        }
        Self::read_config(path, overrides)
    }

    /// Reads a config file, whatever its name.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn read_config(path: &Path, overrides: &[Override]) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let needed = std::fs::metadata(path).map_err(read)?.len();
        if needed > MAX_CONFIG_BYTES {
            return Err(Error::TooLarge { path: path.to_owned(), needed, limit: MAX_CONFIG_BYTES });
        }
        let bytes = std::fs::read(path).map_err(read)?;
        let text = String::from_utf8(bytes).map_err(|_| ConfigError::no_text(path))?;
        let base_dir = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { config: Config::parse(&text, path, overrides)?, base_dir })
    }
}

/// Why a config cannot be used, at which place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{rendered}")]
pub struct ConfigError {
    rendered: String,
    hint: String,
    /// The config; none for what the command line says.
    file: Option<PathBuf>,
    /// The line of it, from 1.
    line: Option<usize>,
}

impl ConfigError {
    fn no_text(path: &Path) -> Box<Self> {
        let rendered = format!("{} is not UTF-8 text", path.display());
        Box::new(Self { rendered, hint: String::new(), file: Some(path.to_owned()), line: None })
    }

    /// The error of what the command line says.
    fn of_set(rendered: String, hint: String) -> Box<Self> {
        Box::new(Self { rendered, hint, file: None, line: None })
    }
}

impl Diagnose for ConfigError {
    fn code(&self) -> &'static str {
        "E-CONFIG"
    }

    fn class(&self) -> Class {
        Class::Usage
    }

    fn hint(&self) -> String {
        self.hint.clone()
    }

    fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    fn line(&self) -> Option<usize> {
        self.line
    }
}

/// A `--set key=value` from the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override {
    /// The dotted key, such as `embed.w_angle`.
    pub key: String,
    /// The value as TOML; what is not TOML is taken as a string.
    pub value: String,
}

impl Config {
    /// The config in `text`, read from `path`, under `overrides`.
    ///
    /// # Errors
    /// [`ConfigError`] with the line, a picture of the place, and the nearest legal key or the legal range.
    pub fn parse(text: &str, path: &Path, overrides: &[Override]) -> Result<Self, Box<ConfigError>> {
        let source = place::SourceText { text, path, overrides };
        // The file alone comes first: only there do errors have a place.
        let alone: Self = toml::from_str(text).map_err(|error| source.parse_error(&error))?;
        let mut config = if overrides.is_empty() { alone } else { source.overridden()? };
        config.settle_root(&source);
        config.validate(&source)?;
        Ok(config)
    }

    /// The one place where a preset reaches beyond its stage: airways hang from the trachea, which is not always their
    /// thickest tip, so `volume.preset = "airway"` makes `tree.root` `"superior"` where neither file nor command line
    /// says what it is.
    fn settle_root(&mut self, source: &place::SourceText<'_>) {
        let is_airway = self.volume.preset == Some(espalier_volume::Preset::Airway);
        if is_airway && !source.sets("tree.root") {
            self.tree.root = espalier_tree::Root::Superior;
        }
    }

    /// The config of a run that is given only its input, under `overrides`.
    ///
    /// # Errors
    /// As [`Config::parse`].
    pub fn for_input(input: &Path, overrides: &[Override]) -> Result<Self, Box<ConfigError>> {
        let path = input.to_string_lossy();
        let name = Self::name_of_input(input);
        let text = format!(
            "schema = {SCHEMA}\nname = {}\n[input]\npath = {}\n",
            toml::Value::from(name),
            toml::Value::from(path.as_ref())
        );
        Self::parse(&text, Path::new(COMMAND_LINE), overrides)
    }

    /// The name of a run that is given only its input.
    fn name_of_input(input: &Path) -> String {
        let file_name = input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let stem = file_name.split('.').next().unwrap_or_default();
        let name: String =
            stem.chars().map(|c| if is_name_character(c) { c } else { '_' }).take(100).collect();
        if name.is_empty() { UNNAMED.to_owned() } else { name }
    }

    /// The name of the run, unless it is only that of the input's file, which may be a patient's.
    pub(crate) fn own_name(&self) -> Option<&str> {
        let of_input = self.input.path.as_ref().map(|path| Self::name_of_input(Path::new(path)));
        let is_own = of_input.as_ref() != Some(&self.name) && self.name != UNNAMED;
        is_own.then_some(self.name.as_str())
    }

    /// The config with every key, as TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        // Plain structs of numbers, strings, enums and tables: serialisation cannot fail.
        toml::to_string(self).unwrap_or_default()
    }

    fn validate(&self, source: &place::SourceText<'_>) -> Result<(), Box<ConfigError>> {
        let at = |table: Option<Stage>| {
            move |error: ParamError| source.value_error(table.map_or("", Stage::name), &error)
        };
        ParamError::check("schema", self.schema == SCHEMA, format!("must be {SCHEMA}, is {}", self.schema))
            .map_err(at(None))?;
        ParamError::check("name", is_folder_name(&self.name), "must be letters, digits, '-', '_' or '.'")
            .map_err(at(None))?;
        ParamError::check(
            "seed",
            i64::try_from(self.seed).is_ok(),
            "must be below 2^63, the largest TOML integer",
        )
        .map_err(at(None))?;
        self.input.validate().map_err(|error| source.value_error("input", &error))?;
        self.phantom.validate().map_err(at(Some(Stage::Phantom)))?;
        self.volume.validate().map_err(at(Some(Stage::Volume)))?;
        self.skeleton.validate().map_err(at(Some(Stage::Skeleton)))?;
        self.radius.validate().map_err(at(Some(Stage::Radius)))?;
        self.tree.validate().map_err(at(Some(Stage::Tree)))?;
        self.views.validate().map_err(at(Some(Stage::Views)))?;
        self.embed.validate().map_err(at(Some(Stage::Embed)))?;
        self.render.validate().map_err(at(Some(Stage::Render)))?;
        self.report.validate().map_err(at(Some(Stage::Report)))
    }
}

/// Whether a name can be a folder of its own anywhere, with no way out of its parent.
fn is_folder_name(name: &str) -> bool {
    !name.is_empty() && name.len() <= 100 && !name.starts_with('.') && name.chars().all(is_name_character)
}

fn is_name_character(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ')
}
