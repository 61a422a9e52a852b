//! A config to start with: what must be set is set, what is often set stands beside it as a comment.
//!
//! **Input** which [`Template`]. **Output** TOML with the first sentence on each key, its range and its default, all from
//! the schema. With the marks before its keys removed it is still a config.

use super::keys::{Key, keys};
use crate::error::Error;

/// What a config is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Template {
    /// Airways from a CT.
    Airway,
    /// Vessels from a CT with contrast.
    Vessel,
    /// A traced neuron.
    Neuron,
    /// The method as published.
    Paper,
}

/// How a key stands in a config.
#[derive(Clone, Copy)]
enum Shown {
    /// With this value.
    Set(&'static str),
    /// As a comment, with its default.
    Default,
    /// As a comment, with this value: it has no default.
    Example(&'static str),
}

use Shown::{Default, Example, Set};

type Line = (&'static str, Shown);

const OF_SCANS: &[Line] = &[
    ("volume.seed_voxel", Example("[58, 80, 85]")),
    ("volume.lower", Example("-1024")),
    ("volume.upper", Example("-865")),
    ("volume.resample_mm", Example("\"isotropic\"")),
    ("volume.closing_mm", Default),
    ("tree.components", Default),
    ("tree.root_mm", Example("[-3.5, 12, 180]")),
    ("tree.prune_factor", Default),
    ("tree.labels", Example("\"lobes.nii.gz\"")),
];

const OF_ALL: &[Line] = &[
    ("embed.methods", Default),
    ("embed.w_length", Default),
    ("embed.w_angle", Default),
    ("embed.widths.mode", Default),
    ("render.width_px", Default),
    ("render.style", Default),
    ("render.color_by", Default),
    ("render.theme", Default),
    ("render.title", Example("\"Case 17\"")),
];

const AIRWAY: &[Line] = &[
    ("name", Set("\"airway\"")),
    ("input.path", Set("\"ct.nii.gz\"")),
    ("volume.preset", Set("\"airway\"")),
];

const VESSEL: &[Line] = &[
    ("name", Set("\"vessel\"")),
    ("input.path", Set("\"ct.nii.gz\"")),
    ("volume.preset", Set("\"vessel\"")),
];

const NEURON: &[Line] = &[
    ("name", Set("\"neuron\"")),
    ("input.path", Set("\"neuron.swc\"")),
    ("input.unit", Default),
    ("input.scale", Default),
    ("input.radius_scale", Default),
    ("tree.roots", Default),
    ("tree.resample", Default),
    ("tree.missing_radii", Default),
];

impl Template {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Airway, Self::Vessel, Self::Neuron, Self::Paper];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Airway => "airway",
            Self::Vessel => "vessel",
            Self::Neuron => "neuron",
            Self::Paper => "paper",
        }
    }

    fn purpose(self) -> &'static str {
        match self {
            Self::Airway => "airways from a CT",
            Self::Vessel => "vessels from a CT with contrast",
            Self::Neuron => "a traced neuron",
            Self::Paper => "the method of Hu et al. 2022 as printed",
        }
    }

    fn lines(self) -> Vec<Line> {
        let parts: &[&[Line]] = match self {
            Self::Airway => &[AIRWAY, OF_SCANS, OF_ALL],
            Self::Vessel => &[VESSEL, OF_SCANS, OF_ALL],
            Self::Neuron => &[NEURON, OF_ALL],
            Self::Paper => &[],
        };
        parts.concat()
    }

    /// The config.
    #[must_use]
    pub fn text(self) -> String {
        if self == Self::Paper {
            return include_str!("../../../../pipelines/paper.toml").to_owned();
        }
        let mut text = format!(
            "# espalier: {}. All keys: espalier config explain; one: espalier config explain tree.root\n\nschema = 1\n",
            self.purpose()
        );
        let (all, mut section) = (keys(), "");
        for (name, shown) in self.lines() {
            let (of, own) = name.rsplit_once('.').unwrap_or(("", name));
            if of != section {
                section = of;
                text.push_str(&format!("\n[{section}]\n"));
            }
            let Some(key) = all.iter().find(|key| key.key == name) else { continue };
            text.push_str(&comment(key));
            let default = key.default.as_deref().unwrap_or_default();
            text.push_str(&match shown {
                Set(value) => format!("{own} = {value}\n"),
                Default => format!("# {own} = {default}\n"),
                Example(value) => format!("# {own} = {value}\n"),
            });
        }
        text
    }

    /// Writes the config to a file that is not there yet.
    ///
    /// # Errors
    /// [`Error::Create`] if it is there, or cannot be created; [`Error::Write`] if it cannot be written.
    pub fn write(self, path: &std::path::Path) -> Result<(), Error> {
        use std::io::Write;
        let create = std::fs::File::create_new(path);
        let mut file = create.map_err(|source| Error::Create { path: path.to_owned(), source })?;
        let written = file.write_all(self.text().as_bytes()).and_then(|()| file.sync_all());
        written.map_err(|source| Error::Write { path: path.to_owned(), source })
    }
}

/// What a key means, in one or two lines of comment.
fn comment(key: &Key) -> String {
    let sentence = first_sentence(&key.text);
    let words: Vec<String> = key.choices.iter().map(|(word, _)| format!("{word:?}")).collect();
    let facts = [(!words.is_empty()).then(|| words.join(", ")), key.range.clone()];
    let facts: Vec<String> = facts.into_iter().flatten().collect();
    let mut lines = vec![format!("# {sentence}")];
    lines.extend((!facts.is_empty()).then(|| format!("#   {}", facts.join("; "))));
    lines.join("\n") + "\n"
}

/// Up to the first full stop that ends a sentence.
fn first_sentence(text: &str) -> &str {
    let end = text.match_indices(". ").find(|(at, _)| text[at + 2..].starts_with(|c: char| c.is_uppercase()));
    end.map_or(text, |(at, _)| &text[..=at])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::Config;

    #[test]
    fn templates_load_with_and_without_their_comments() {
        for template in Template::ALL {
            let text = template.text();
            let config = Config::parse(&text, Path::new("a.toml"), &[])
                .unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert!(config.input.path.is_some() || template == Template::Paper);
            let is_key = |line: &str| line.starts_with("# ") && line.split(' ').nth(2) == Some("=");
            let bare: Vec<&str> =
                text.lines().map(|line| if is_key(line) { &line[2..] } else { line }).collect();
            let bare = bare.join("\n");
            Config::parse(&bare, Path::new("a.toml"), &[]).unwrap_or_else(|error| panic!("{error}\n{bare}"));
            // A comment shows the default, so that it changes nothing to say so.
            let n_keys = text.lines().filter(|line| is_key(line)).count();
            assert!(n_keys > 10 || template == Template::Paper, "{n_keys}");
            assert_eq!(n_keys, template.lines().iter().filter(|(_, shown)| !matches!(shown, Set(_))).count());
        }
    }

    #[test]
    fn a_file_is_never_written_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("my.toml");
        Template::Neuron.write(&path).expect("written");
        assert_eq!(std::fs::read_to_string(&path).expect("text"), Template::Neuron.text());
        assert!(matches!(Template::Airway.write(&path), Err(Error::Create { .. })));
        assert_eq!(std::fs::read_to_string(&path).expect("text"), Template::Neuron.text());
    }
}
