//! Files that a config names beside the input of the run.

use crate::config::Config;
use crate::stage::Stage;

/// A file beside the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SideFile {
    /// `input.labels`: the names of the input's values.
    InputLabels,
    /// `tree.labels`: a label map.
    Labels,
    /// `tree.label_names`: the names of its values.
    LabelNames,
    /// `embed.edits`: manual edits.
    Edits,
    /// `embed.marino.view_file`: the view of the baseline.
    MarinoView,
    /// `radius.image`: the scan in which walls are looked for.
    WallImage,
    /// `render.volume.image`: the scan on the map.
    Image,
}

impl SideFile {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::InputLabels,
        Self::Labels,
        Self::LabelNames,
        Self::Edits,
        Self::MarinoView,
        Self::WallImage,
        Self::Image,
    ];

    /// The name in provenance.
    pub(crate) fn role(self) -> &'static str {
        match self {
            Self::InputLabels => "input_labels",
            Self::Labels => "labels",
            Self::LabelNames => "label_names",
            Self::Edits => "edits",
            Self::MarinoView => "marino_view",
            Self::WallImage => "wall_image",
            Self::Image => "image",
        }
    }

    /// The key in the config.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::InputLabels => "input.labels",
            Self::Labels => "tree.labels",
            Self::LabelNames => "tree.label_names",
            Self::Edits => "embed.edits",
            Self::MarinoView => "embed.marino.view_file",
            Self::WallImage => "radius.image",
            Self::Image => "render.volume.image",
        }
    }

    /// Whether it is a volume, which can be a folder of slices.
    pub(crate) fn is_volume(self) -> bool {
        matches!(self, Self::Labels | Self::WallImage | Self::Image)
    }

    /// The stage that reads it.
    pub(crate) fn stage(self) -> Stage {
        match self {
            Self::InputLabels => Stage::Volume,
            Self::Labels | Self::LabelNames => Stage::Tree,
            Self::Edits | Self::MarinoView => Stage::Embed,
            Self::WallImage => Stage::Radius,
            Self::Image => Stage::Render,
        }
    }

    /// Where the config has its path.
    #[must_use]
    pub fn slot(self, config: &mut Config) -> &mut Option<String> {
        match self {
            Self::InputLabels => &mut config.input.labels,
            Self::Labels => &mut config.tree.labels,
            Self::LabelNames => &mut config.tree.label_names,
            Self::Edits => &mut config.embed.edits,
            Self::MarinoView => &mut config.embed.marino.view_file,
            Self::WallImage => &mut config.radius.image,
            Self::Image => &mut config.render.volume.image,
        }
    }

    /// Its path as the config has it; none if the config names no such file.
    pub(crate) fn path_in(self, config: &Config) -> Option<&str> {
        let path = match self {
            Self::InputLabels => &config.input.labels,
            Self::Labels => &config.tree.labels,
            Self::LabelNames => &config.tree.label_names,
            Self::Edits => &config.embed.edits,
            Self::MarinoView => &config.embed.marino.view_file,
            Self::WallImage => &config.radius.image,
            Self::Image => &config.render.volume.image,
        };
        path.as_deref().filter(|path| !path.is_empty())
    }
}
