//! The stages, their order, and the files between them.

use std::fmt;

use crate::provenance::INPUTS_FILE;

/// A stage of the pipeline. The order is the order of the data flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Make a phantom: a CT, or a traced tree.
    Phantom,
    /// CT or label map → mask.
    Volume,
    /// Mask → curve skeleton voxels.
    Skeleton,
    /// Inscribed sphere at each skeleton voxel.
    Radius,
    /// Skeleton and spheres, or a traced tree → one rooted tree.
    Tree,
    /// Tree → views and local planes.
    Views,
    /// Tree and views → planar embedding.
    Embed,
    /// Embedding → pictures.
    Render,
    /// Everything before → the page of the run.
    Report,
}

/// Where the `volume` stage leaves its part of the topology ledger.
pub(crate) const DROPPED_FILE: &str = "stages/01-volume/dropped.tsv";

/// A piece of hand-over data that has a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Artifact {
    /// A CT or label volume.
    Volume,
    /// A traced tree.
    Traced,
    /// A mask.
    Mask,
    /// Curve skeleton voxels.
    Skeleton,
    /// Inscribed spheres.
    Spheres,
    /// A rooted tree.
    Tree,
    /// Views and local planes.
    Views,
    /// A planar embedding.
    Embedding,
    /// The layouts of all methods.
    Comparison,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 9] = [
        Self::Phantom,
        Self::Volume,
        Self::Skeleton,
        Self::Radius,
        Self::Tree,
        Self::Views,
        Self::Embed,
        Self::Render,
        Self::Report,
    ];

    /// The name in configs, commands and folders.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Phantom => "phantom",
            Self::Volume => "volume",
            Self::Skeleton => "skeleton",
            Self::Radius => "radius",
            Self::Tree => "tree",
            Self::Views => "views",
            Self::Embed => "embed",
            Self::Render => "render",
            Self::Report => "report",
        }
    }

    /// The stage of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }

    /// Its folder inside a run folder.
    #[must_use]
    pub fn folder(self) -> String {
        format!("stages/{:02}-{}", self as u8, self.name())
    }

    /// The artifacts it reads, in the order in which its command takes them. A stage that can start from either
    /// of two (a tree from a mask or from a traced tree) lists the first way.
    #[must_use]
    pub fn reads(self) -> &'static [Artifact] {
        match self {
            Self::Phantom => &[],
            Self::Volume => &[Artifact::Volume],
            Self::Skeleton => &[Artifact::Mask],
            Self::Radius => &[Artifact::Mask, Artifact::Skeleton],
            Self::Tree => &[Artifact::Mask, Artifact::Skeleton, Artifact::Spheres],
            Self::Views => &[Artifact::Tree],
            Self::Embed => &[Artifact::Tree, Artifact::Views],
            Self::Render | Self::Report => &[Artifact::Tree, Artifact::Views, Artifact::Embedding],
        }
    }

    /// The version of what it makes. A change of the code that changes results takes the next number, or folders keep what
    /// the code before made.
    pub(crate) fn version(self) -> u32 {
        match self {
            Self::Phantom | Self::Views => 1,
            Self::Radius | Self::Skeleton => 3,
            Self::Tree | Self::Embed | Self::Render => 4,
            Self::Report => 5,
            Self::Volume => 7,
        }
    }

    /// The files of earlier stages that it reads beside its artifacts, relative to the run folder. The page reads every
    /// file of every earlier stage.
    pub(crate) fn reads_beside(self) -> Vec<String> {
        match self {
            Self::Tree => [DROPPED_FILE, Artifact::Traced.file()].map(str::to_owned).into(),
            // The scan only where walls are looked for in it.
            Self::Radius => vec![Artifact::Volume.file().to_owned()],
            // The scan only for a map that shows it; of the mask and of the labels of branches the organ beside the map.
            Self::Render => {
                let read = [Artifact::Comparison, Artifact::Volume, Artifact::Mask].map(Artifact::file);
                read.into_iter().chain(["branches.tsv"]).map(str::to_owned).collect()
            }
            Self::Report => {
                let earlier = Self::ALL.into_iter().filter(|other| *other < self).flat_map(Self::writes);
                earlier.chain([INPUTS_FILE.to_owned()]).collect()
            }
            _ => Vec::new(),
        }
    }

    /// All files of earlier stages that it reads, relative to the run folder.
    pub(crate) fn files_read(self) -> impl Iterator<Item = String> {
        self.reads().iter().map(|artifact| artifact.file().to_owned()).chain(self.reads_beside())
    }

    /// Whether it reads a file that another stage writes.
    pub(crate) fn follows(self, other: Self) -> bool {
        let written = other.writes();
        other < self && self.files_read().any(|file| written.contains(&file))
    }

    /// Every file it may write, relative to the run folder.
    #[must_use]
    pub fn writes(self) -> Vec<String> {
        let files: &[&str] = match self {
            Self::Phantom => &["ct.nii.gz", "truth-mask.nii.gz", "truth.swc"],
            Self::Volume => &[
                "mask.nii.gz",
                "dropped.tsv",
                "growth.tsv",
                "seeds.tsv",
                "slices-axial.png",
                "slices-coronal.png",
                "slices-sagittal.png",
            ],
            Self::Skeleton => &["skeleton.nii.gz"],
            Self::Radius => &["radius.nii.gz", "distance.nii.gz", "spheres.tsv"],
            Self::Tree => &[
                "/tree.swc",
                "/tree.vtp",
                "/tree.graphml",
                "/branches.tsv",
                "/generations.tsv",
                "/profiles.tsv",
                "/stenoses.tsv",
                "/topology.tsv",
                "/branches.nii.gz",
                "/branches.ctbl",
                "/branches.label.txt",
                // The embed stage on files of its own writes it too.
                "/dictionary.tsv",
            ],
            Self::Views => &["/views.json"],
            Self::Embed => &[
                "/embedding.json",
                "/nodes.tsv",
                "/compare.tsv",
                "/compare.json",
                "/dictionary.tsv",
                "convergence.tsv",
            ],
            Self::Render => &[
                "/planar.png",
                "/planar.svg",
                "/planar.pdf",
                "/planar.exr",
                "/global-view.png",
                "/space.png",
                "/space.svg",
                "/compare.png",
                "/compare.svg",
                "/convergence.png",
                "/convergence.svg",
            ],
            Self::Report => &["/report.html", "/provenance/methods.md", "/provenance/references.bib"],
        };
        let folder = self.folder();
        let mut paths: Vec<String> = files
            .iter()
            .map(|file| file.strip_prefix('/').map_or_else(|| format!("{folder}/{file}"), str::to_owned))
            .collect();
        // The record last: it says that the others are there.
        paths.extend(["report.json", "record.json"].map(|file| format!("{folder}/{file}")));
        paths
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Artifact {
    /// All artifacts in the order in which they arise.
    pub const ALL: [Self; 9] = [
        Self::Volume,
        Self::Traced,
        Self::Mask,
        Self::Skeleton,
        Self::Spheres,
        Self::Tree,
        Self::Views,
        Self::Embedding,
        Self::Comparison,
    ];

    /// Its file, relative to the run folder.
    #[must_use]
    pub fn file(self) -> &'static str {
        match self {
            Self::Volume => "stages/00-phantom/ct.nii.gz",
            Self::Traced => "stages/00-phantom/truth.swc",
            Self::Mask => "stages/01-volume/mask.nii.gz",
            Self::Skeleton => "stages/02-skeleton/skeleton.nii.gz",
            Self::Spheres => "stages/03-radius/spheres.tsv",
            Self::Tree => "tree.swc",
            Self::Views => "views.json",
            Self::Embedding => "embedding.json",
            Self::Comparison => "compare.json",
        }
    }

    /// What it is, for messages.
    #[must_use]
    pub fn what(self) -> &'static str {
        match self {
            Self::Volume => "volume",
            Self::Traced => "traced tree",
            Self::Mask => "mask",
            Self::Skeleton => "skeleton",
            Self::Spheres => "table of inscribed spheres",
            Self::Tree => "tree",
            Self::Views => "view hierarchy",
            Self::Embedding => "embedding",
            Self::Comparison => "comparison of methods",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_artifact_read_is_written_by_an_earlier_stage() {
        for stage in Stage::ALL {
            for artifact in stage.reads() {
                let writer = Stage::ALL.into_iter().find(|s| s.writes().iter().any(|w| w == artifact.file()));
                assert!(writer.is_some_and(|writer| writer < stage), "{stage} reads {artifact:?}");
            }
        }
    }

    #[test]
    fn names_are_their_own_inverse() {
        for stage in Stage::ALL {
            assert_eq!(Stage::from_name(stage.name()), Some(stage));
        }
        assert_eq!(Stage::from_name("emebd"), None);
    }
}
