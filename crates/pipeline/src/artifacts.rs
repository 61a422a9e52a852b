//! Hand-over data: from memory where a stage of this run has just made it, else from its file.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use espalier_model::swc::{self, Traced};
use espalier_model::{
    Comparison, Diagnose, Edits, Embedding, InscribedSpheres, Ledger, Mask, Report, Skeleton, Tree,
    ViewHierarchy, view_axes_from_json,
};
use espalier_model::{label_table, polydata};
use espalier_tree::LabelMap;
use espalier_volume::{Orientation, Pieces};
use glam::DVec3;

use crate::config::{Input, Source, Unit};
use crate::error::Error;
use crate::folder::RunFolder;
use crate::side_file::SideFile;
use crate::stage::{Artifact, DROPPED_FILE, Stage};

/// The header key of `tree.swc` that says what the tree was made from, and what it says.
pub(crate) const SOURCE_KEY: &str = "source";
pub(crate) const SOURCE_SCAN: &str = "scan";
pub(crate) const SOURCE_TRACING: &str = "tracing";

/// The hand-over data of a run.
#[derive(Default)]
pub(crate) struct Artifacts {
    /// Files named by the user, instead of those in the run folder.
    pub(crate) files: BTreeMap<Artifact, PathBuf>,
    /// Files that the config names beside the input.
    pub(crate) side_paths: BTreeMap<SideFile, PathBuf>,
    pub(crate) read_options: espalier_volume::ReadOptions,
    /// The axis order of masks and skeletons, also of those that the user names.
    pub(crate) orientation: Orientation,
    /// How a traced tree is scaled.
    pub(crate) input: Input,
    /// Whether neither the user nor the traced tree's file has said what its unit is.
    pub(crate) is_unit_guessed: bool,
    pub(crate) traced: Option<Arc<Traced>>,
    pub(crate) mask: Option<Arc<Mask>>,
    /// What the mask has lost on the way from the scan.
    pub(crate) dropped: Option<Ledger>,
    pub(crate) skeleton: Option<Arc<Skeleton>>,
    pub(crate) spheres: Option<Arc<InscribedSpheres>>,
    pub(crate) tree: Option<Arc<Tree>>,
    /// Whether the tree was made from a scan, so that its space is a body's.
    pub(crate) is_of_scan: bool,
    pub(crate) views: Option<Arc<ViewHierarchy>>,
    pub(crate) embedding: Option<Arc<Embedding>>,
    pub(crate) comparison: Option<Arc<Comparison>>,
}

/// Where an artifact is looked for, and for whom.
#[derive(Clone, Copy)]
pub(crate) struct Lookup<'a> {
    pub(crate) folder: &'a RunFolder,
    pub(crate) stage: Stage,
}

impl Artifacts {
    /// Whether the tree comes from a traced one. A mask named by the user goes before the config's source.
    pub(crate) fn is_traced(&self, source: &Source) -> bool {
        let named = |artifact| self.files.contains_key(&artifact);
        named(Artifact::Traced)
            || (matches!(source, Source::PhantomTree(_) | Source::Tree(_)) && !named(Artifact::Mask))
    }

    /// The mask that the stage `volume` makes of the scan, with what its reader had to say.
    pub(crate) fn segmented(
        &self,
        lookup: Lookup<'_>,
        params: &espalier_volume::Params,
    ) -> Result<espalier_volume::Segmented, Error> {
        let path = self.locate(Artifact::Volume, lookup)?;
        let (params, notes) = self.with_label_values(params)?;
        let made = espalier_volume::read_mask(&path, &self.read_options, &params);
        let mut segmented = made.map_err(|error| match error {
            // The reader's own message names the file; the others know the volume, not where it came from.
            espalier_volume::Error::Read { .. } => Error::stage(lookup.stage)(Box::new(error)),
            error => Error::file(&path, error),
        })?;
        for note in notes {
            segmented.report.warn("W-VOLUME-LABEL-NAME", format!("{note} by the names of input.labels"));
        }
        Ok(segmented)
    }

    /// The parameters with values in place of the user's own names of labels, and a sentence for each name.
    fn with_label_values(
        &self,
        params: &espalier_volume::Params,
    ) -> Result<(espalier_volume::Params, Vec<String>), Error> {
        let (Some(labels), Some(path)) = (&params.label, self.side_paths.get(&SideFile::InputLabels)) else {
            return Ok((params.clone(), Vec::new()));
        };
        let names = self.label_names(path)?;
        let (values, notes) = labels.by_names(&names).map_err(|error| Error::file(path, error))?;
        Ok((espalier_volume::Params { label: Some(values), ..params.clone() }, notes))
    }

    fn label_names(&self, path: &Path) -> Result<BTreeMap<i64, String>, Error> {
        label_table::parse_names(&self.read_text(path)?).map_err(|error| Error::file(path, error))
    }

    /// The values of the scan, as they were read for the mask.
    pub(crate) fn scan(&mut self, lookup: Lookup<'_>) -> Result<Pieces, Error> {
        let path = self.locate(Artifact::Volume, lookup)?;
        espalier_volume::open_pieces(&path, &self.read_options)
            .map_err(|error| Error::stage(lookup.stage)(Box::new(error)))
    }

    /// What a scan has between two corners of the world, RAS+ mm: the one that the config names beside the input, else the
    /// run's own input; with its path.
    pub(crate) fn scan_in_box(
        &self,
        lookup: Lookup<'_>,
        (side, corners_mm, n_around): (SideFile, [DVec3; 2], u32),
    ) -> Result<(espalier_volume::Cropped, PathBuf), Error> {
        let side = self.side_paths.get(&side);
        let (path, options) = match side {
            Some(path) => (path.clone(), self.beside_options()),
            None => (self.locate(Artifact::Volume, lookup)?, self.read_options),
        };
        let mut cropped = espalier_volume::read_box(&path, &options, (corners_mm, n_around))
            .map_err(|error| Error::stage(lookup.stage)(Box::new(error)))?;
        if side.is_none() {
            // The volume stage has said it.
            cropped.report = Report::default();
        }
        Ok((cropped, path))
    }

    /// The files that one beside the input is made of: several where it is a DICOM series, or a header
    /// with its data; none if there is none.
    pub(crate) fn files_beside(&self, side: SideFile, stage: Stage) -> Result<Vec<PathBuf>, Error> {
        let Some(path) = self.side_paths.get(&side) else { return Ok(Vec::new()) };
        if !side.is_volume() {
            return Ok(vec![path.clone()]);
        }
        espalier_volume::files(path, &self.beside_options())
            .map_err(|error| Error::stage(stage)(Box::new(error)))
    }

    /// How volumes beside the input are read. Volume, series, unit and resampling are the input's own. What space a file
    /// without one is in is not: both come from the same program, mostly.
    fn beside_options(&self) -> espalier_volume::ReadOptions {
        espalier_volume::ReadOptions {
            volume_index: None,
            unit_mm: None,
            series: None,
            resample: false,
            ..self.read_options
        }
    }

    /// The traced tree, with what its reader had to say.
    pub(crate) fn traced(&mut self, lookup: Lookup<'_>) -> Result<(Arc<Traced>, Report), Error> {
        if let Some(traced) = &self.traced {
            return Ok((Arc::clone(traced), Report::default()));
        }
        let path = self.locate(Artifact::Traced, lookup)?;
        let bytes = self.read_bounded(&path)?;
        let is_polydata = polydata::is_polydata(&bytes);
        // What states no unit is in µm, but for our own files and those of VTK.
        let is_mm = is_polydata || swc::is_own(&bytes);
        let scale = self.input.traced_scale(is_mm);
        self.is_unit_guessed = self.input.unit == Unit::Auto && self.input.scale == [1.0; 3] && !is_mm;
        let (traced, report) = if is_polydata {
            let assumed = self.input.assume_space.map(espalier_volume::AssumedSpace::ras_signs);
            let parsed = polydata::parse(&bytes, &scale, assumed, self.read_options.max_bytes)
                .map_err(|error| Error::file(&path, error))?;
            let (traced, joined) = espalier_tree::join_lines(&parsed.0);
            let mut report = parsed.1;
            report.extend(joined);
            (traced, report)
        } else {
            let (needed, limit) = (swc::memory_bytes(&bytes), self.read_options.max_bytes);
            if needed > limit {
                return Err(Error::TooLarge { path, needed, limit });
            }
            swc::parse(&bytes, &scale).map_err(|error| Error::file(&path, error))?
        };
        let traced = Arc::new(traced);
        self.traced = Some(Arc::clone(&traced));
        Ok((traced, report))
    }

    pub(crate) fn mask(&mut self, lookup: Lookup<'_>) -> Result<Arc<Mask>, Error> {
        if let Some(mask) = &self.mask {
            return Ok(Arc::clone(mask));
        }
        let path = self.locate(Artifact::Mask, lookup)?;
        let mask = self.read_nonzero(&path, lookup.stage)?;
        let mask = espalier_volume::in_order(mask, self.orientation).map_err(|e| Error::file(&path, e))?;
        let mask = Arc::new(mask);
        self.mask = Some(Arc::clone(&mask));
        Ok(mask)
    }

    /// The ledger of the mask; empty for a mask that was not made here.
    pub(crate) fn dropped(&mut self, lookup: Lookup<'_>) -> Result<Ledger, Error> {
        if let Some(dropped) = &self.dropped {
            return Ok(dropped.clone());
        }
        let path = lookup.folder.path().join(DROPPED_FILE);
        if !path.exists() {
            return Ok(Ledger::default());
        }
        let text = String::from_utf8_lossy(&lookup.folder.read(DROPPED_FILE)?).into_owned();
        Ledger::from_tsv(&text).map_err(|error| Error::file(&path, error))
    }

    pub(crate) fn skeleton(&mut self, lookup: Lookup<'_>) -> Result<Arc<Skeleton>, Error> {
        if let Some(skeleton) = &self.skeleton {
            return Ok(Arc::clone(skeleton));
        }
        let path = self.locate(Artifact::Skeleton, lookup)?;
        let marked = self.read_nonzero(&path, lookup.stage)?;
        // Extents fit 32 bits: a file has none larger.
        let voxels = marked.voxels().map(|voxel| voxel.map(|coordinate| coordinate as u32)).collect();
        let mut skeleton = Skeleton::new(marked.grid().clone(), voxels);
        if self.orientation == Orientation::Ras {
            skeleton = skeleton.in_ras_order().map_err(|error| Error::file(&path, error))?;
        }
        let skeleton = Arc::new(skeleton);
        self.skeleton = Some(Arc::clone(&skeleton));
        Ok(skeleton)
    }

    pub(crate) fn spheres(&mut self, lookup: Lookup<'_>) -> Result<Arc<InscribedSpheres>, Error> {
        let spheres = self.spheres.clone();
        let spheres = self.parsed(spheres, Artifact::Spheres, lookup, InscribedSpheres::from_tsv)?;
        self.spheres = Some(Arc::clone(&spheres));
        Ok(spheres)
    }

    pub(crate) fn tree(&mut self, lookup: Lookup<'_>) -> Result<Arc<Tree>, Error> {
        let (tree, mut is_of_scan) = (self.tree.clone(), self.is_of_scan);
        let tree = self.parsed(tree, Artifact::Tree, lookup, |text| {
            is_of_scan = swc::header_value(text, SOURCE_KEY) == Some(SOURCE_SCAN);
            swc::read_tree(text)
        })?;
        self.is_of_scan = is_of_scan;
        self.tree = Some(Arc::clone(&tree));
        Ok(tree)
    }

    pub(crate) fn views(&mut self, lookup: Lookup<'_>) -> Result<Arc<ViewHierarchy>, Error> {
        let tree = self.tree(lookup)?;
        let views = self.views.clone();
        let views =
            self.parsed(views, Artifact::Views, lookup, |text| ViewHierarchy::from_json(text, &tree))?;
        self.views = Some(Arc::clone(&views));
        Ok(views)
    }

    /// The manual edits of the embedding of `tree`; none if the config names no file of them.
    pub(crate) fn edits(&self, tree: &Tree) -> Result<Edits, Error> {
        let Some(path) = self.side_paths.get(&SideFile::Edits) else { return Ok(Edits::none(tree)) };
        Edits::from_json(&self.read_text(path)?, tree).map_err(|error| Error::file(path, error))
    }

    /// The axes of the baseline's view, towards the camera and up; none if the config names no file of them.
    pub(crate) fn marino_axes(&self) -> Result<Option<(DVec3, DVec3)>, Error> {
        let Some(path) = self.side_paths.get(&SideFile::MarinoView) else { return Ok(None) };
        view_axes_from_json(&self.read_text(path)?).map(Some).map_err(|error| Error::file(path, error))
    }

    /// The label map that branches are labelled by; none if the config names no file of one.
    pub(crate) fn label_map(&self, lookup: Lookup<'_>, reach_mm: f64) -> Result<Option<LabelMap>, Error> {
        let Some(path) = self.side_paths.get(&SideFile::Labels) else { return Ok(None) };
        let loaded = espalier_volume::read(path, &self.beside_options())
            .map_err(|error| Error::stage(lookup.stage)(Box::new(error)))?;
        espalier_volume::check_regions(&loaded.volume).map_err(|error| Error::file(path, error))?;
        let (names, colors) = match self.side_paths.get(&SideFile::LabelNames) {
            Some(path) => (self.label_names(path)?, label_table::parse_colors(&self.read_text(path)?)),
            None => (BTreeMap::new(), BTreeMap::new()),
        };
        Ok(Some(LabelMap { volume: loaded.volume, names, colors, reach_mm }))
    }

    pub(crate) fn embedding(&mut self, lookup: Lookup<'_>) -> Result<Arc<Embedding>, Error> {
        let tree = self.tree(lookup)?;
        let embedding = self.embedding.clone();
        let known = embedding.is_some();
        let embedding =
            self.parsed(embedding, Artifact::Embedding, lookup, |text| Embedding::from_json(text, &tree))?;
        if !known {
            // What a file says of itself is checked before a picture repeats it.
            let (stated, found) =
                (&embedding.certificate, espalier_embed::certify(&tree, &embedding.positions_mm));
            if *stated != found {
                let path = self.locate(Artifact::Embedding, lookup)?;
                return Err(Error::Certificate { path, stated: stated.crossings, found: found.crossings });
            }
        }
        self.embedding = Some(Arc::clone(&embedding));
        Ok(embedding)
    }

    /// The layouts of all methods. None where there is no such file: a picture can do without it; nor for files that
    /// the user names without it, for what lies in the folder may be another tree's.
    pub(crate) fn comparison(&mut self, lookup: Lookup<'_>) -> Result<Option<Arc<Comparison>>, Error> {
        let is_named = self.files.contains_key(&Artifact::Comparison);
        let in_folder = lookup.folder.path().join(Artifact::Comparison.file());
        let is_foreign = self.files.contains_key(&Artifact::Embedding) || !in_folder.exists();
        if self.comparison.is_none() && !is_named && is_foreign {
            return Ok(None);
        }
        let tree = self.tree(lookup)?;
        let known = self.comparison.clone();
        let comparison =
            self.parsed(known, Artifact::Comparison, lookup, |text| Comparison::from_json(text, &tree))?;
        self.comparison = Some(Arc::clone(&comparison));
        Ok(Some(comparison))
    }

    /// What memory has, else what `parse` makes of the artifact's file.
    fn parsed<T, E: Diagnose + Send + Sync + 'static>(
        &self,
        in_memory: Option<Arc<T>>,
        artifact: Artifact,
        lookup: Lookup<'_>,
        parse: impl FnOnce(&str) -> Result<T, E>,
    ) -> Result<Arc<T>, Error> {
        if let Some(known) = in_memory {
            return Ok(known);
        }
        let path = self.locate(artifact, lookup)?;
        let text = self.read_text(&path)?;
        parse(&text).map(Arc::new).map_err(|error| Error::file(&path, error))
    }

    fn read_text(&self, path: &Path) -> Result<String, Error> {
        let not_text =
            |_| Error::Read { path: path.to_owned(), source: io::Error::from(io::ErrorKind::InvalidData) };
        String::from_utf8(self.read_bounded(path)?).map_err(not_text)
    }

    /// The bytes of a file that is held in memory whole.
    fn read_bounded(&self, path: &Path) -> Result<Vec<u8>, Error> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        let (needed, limit) = (fs::metadata(path).map_err(read)?.len(), self.read_options.max_bytes);
        if needed > limit {
            return Err(Error::TooLarge { path: path.to_owned(), needed, limit });
        }
        fs::read(path).map_err(read)
    }

    fn read_nonzero(&self, path: &Path, stage: Stage) -> Result<Mask, Error> {
        // The reader's own message names the file.
        espalier_volume::read_nonzero(path, &self.read_options)
            .map_err(|error| Error::stage(stage)(Box::new(error)))
    }

    /// The file of an artifact: the one that the user named, else that of the run folder, checked.
    fn locate(&self, artifact: Artifact, lookup: Lookup<'_>) -> Result<PathBuf, Error> {
        if let Some(path) = self.files.get(&artifact) {
            return Ok(path.clone());
        }
        let path = lookup.folder.path().join(artifact.file());
        if !path.exists() {
            return Err(Error::MissingArtifact { stage: lookup.stage, artifact, path });
        }
        lookup.folder.read(artifact.file())?;
        Ok(path)
    }
}
