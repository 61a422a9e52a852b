//! Every reader of files that are not ours to trust.
//!
//! **Output** [`readers`]: each with seeds, and a function that reads a mutant as the program would.
//! **Guarantees** what is accepted is within the limit that was stated; what is refused says so in a message that fits
//! a terminal. A reader of files finds those of its mutant and no others, so that what came before decides nothing.

use std::{fs, io};

use espalier_geom::random::{Purpose, Stream};
use espalier_model::swc::{self, SwcScale};
use espalier_model::{Comparison, Diagnose, Edits, Embedding, InscribedSpheres, Ledger, ViewHierarchy};
use espalier_model::{label_table, polydata, view_axes_from_json};
use espalier_volume::{AssumedSpace, Params, ReadOptions, files, open_pieces, read, read_box, read_mask};
use glam::DVec3;

use super::run_seeds::Ran;
use super::{Mutant, Seed, dicom_seeds, mutate, run_seeds, seeds};

/// What a reader may hold.
const MAX_BYTES: u64 = 1 << 20;
/// A message that is longer says too much.
const MAX_MESSAGE_BYTES: usize = 4096;

/// What came of a mutant: accepted, or the code of the error.
type Outcome = Result<(), String>;

/// What reads the files of a mutant; the number varies how.
type Read = dyn Fn(&Mutant, u32) -> Outcome;

/// A reader.
pub struct Reader {
    /// What it reads.
    pub name: &'static str,
    seeds: Vec<Seed>,
    read: Box<Read>,
}

impl Reader {
    fn new(name: &'static str, seeds: Vec<Seed>, read: impl Fn(&Mutant, u32) -> Outcome + 'static) -> Self {
        Self { name, seeds, read: Box::new(read) }
    }

    /// A reader of bytes.
    fn of_bytes(name: &'static str, seeds: Vec<Seed>, read: impl Fn(&[u8]) -> Outcome + 'static) -> Self {
        Self::new(name, seeds, move |mutant, _| read(&mutant.files[0].1))
    }

    /// A reader of text; what is no UTF-8 never reaches it.
    fn of_text(name: &'static str, seeds: Vec<Seed>, read: impl Fn(&str) -> Outcome + 'static) -> Self {
        Self::of_bytes(name, seeds, move |bytes| read(&String::from_utf8_lossy(bytes)))
    }

    /// The mutant of a number: a function of it, the seed number and the reader's name.
    #[must_use]
    pub fn mutant(&self, seed: u64, index: u32) -> Mutant {
        let key = self.name.bytes().fold(0_u32, |key, byte| key.wrapping_mul(31).wrapping_add(byte.into()));
        let mut stream = Stream::new(seed, Purpose::Test, key, index);
        let mut any = || &self.seeds[stream.below(self.seeds.len() as u32) as usize];
        let (of, other) = (any(), any());
        mutate::mutate(of, other, &mut stream)
    }

    /// Reads a mutant.
    ///
    /// # Errors
    /// The code of the error.
    ///
    /// # Panics
    /// Where the reader does, and where its message is too long.
    pub fn read(&self, mutant: &Mutant, index: u32) -> Result<(), String> {
        (self.read)(mutant, index)
    }

    /// A seed with another first file.
    #[must_use]
    pub fn with_first(&self, bytes: &[u8]) -> Mutant {
        let mut mutant = mutate::unchanged(&self.seeds[0]);
        mutant.files[0].1 = bytes.to_vec();
        mutant
    }

    /// How many seeds there are.
    #[must_use]
    pub fn n_seeds(&self) -> usize {
        self.seeds.len()
    }

    /// The seeds as they are, each of which must be accepted.
    #[must_use]
    pub fn unchanged(&self) -> Vec<Mutant> {
        self.seeds.iter().map(mutate::unchanged).collect()
    }
}

/// All of them.
#[must_use]
pub fn readers() -> Vec<Reader> {
    let ran = Ran::new();
    let vtp = fs::read(ran.out.join("tree.vtp")).unwrap_or_default();
    let tree = || ran.tree.clone();
    let (embedded, viewed, compared, edited) = (tree(), tree(), tree(), tree());
    vec![
        volume("nifti-1", seeds::nifti_1_files()),
        volume("nifti-2", seeds::nifti_2_files()),
        volume("nifti.gz", seeds::nifti_gz_files()),
        volume("nifti-pair", seeds::nifti_pairs()),
        volume("nrrd", seeds::nrrd_files()),
        volume("nhdr", seeds::nhdr_files()),
        volume("mha", seeds::mha_files()),
        volume("mhd", seeds::mhd_files()),
        volume("dicom", dicom_seeds::series()),
        Reader::of_bytes("swc", seeds::swc_files(), |bytes| {
            outcome(swc::parse(bytes, &SwcScale::micrometres()))
        }),
        Reader::of_bytes("vtp", seeds::vtp_files(&vtp), polylines),
        Reader::of_bytes("vtk", seeds::vtk_files(), polylines),
        Reader::of_text("tree.swc", ran.seed("tree.swc"), |text| outcome(swc::read_tree(text))),
        Reader::of_text("views.json", ran.seed("views.json"), move |text| {
            let _ = outcome(view_axes_from_json(text));
            outcome(ViewHierarchy::from_json(text, &viewed))
        }),
        Reader::of_text("embedding.json", ran.seed("embedding.json"), move |text| {
            outcome(Embedding::from_json(text, &embedded))
        }),
        Reader::of_text("compare.json", ran.seed("compare.json"), move |text| {
            outcome(Comparison::from_json(text, &compared))
        }),
        Reader::of_text("edits.json", ran.edits(), move |text| outcome(Edits::from_json(text, &edited))),
        Reader::of_text("topology.tsv", ran.seed("topology.tsv"), |text| outcome(Ledger::from_tsv(text))),
        Reader::of_text("spheres.tsv", run_seeds::spheres(), |text| {
            outcome(InscribedSpheres::from_tsv(text))
        }),
        Reader::of_text("label-names", run_seeds::label_names(), |text| {
            let _ = label_table::parse_colors(text);
            outcome(label_table::parse_names(text))
        }),
    ]
}

/// A reader of volumes, in each of the ways in which they are read.
fn volume(name: &'static str, seeds: Vec<Seed>) -> Reader {
    Reader::new(name, seeds, |mutant, index| {
        let written = written(mutant).map_err(|error| error.to_string())?;
        let folder = written.path();
        let is_series = mutant.files.len() > 2;
        let path = if is_series && index & 1 == 0 { folder } else { &folder.join(mutant.files[0].0) };
        let options = ReadOptions {
            max_bytes: MAX_BYTES,
            volume_index: (index & 2 == 0).then_some(0),
            assume_space: (index & 4 == 0).then_some(AssumedSpace::Lps),
            resample: index & 8 == 0,
            ..ReadOptions::default()
        };
        match index / 16 % 5 {
            0 | 1 => outcome(read(path, &options).inspect(|loaded| {
                assert!(loaded.volume.grid().n_voxels() as u64 <= MAX_BYTES, "more voxels than allowed");
            })),
            2 => outcome(read_mask(path, &options, &Params::default())),
            3 => outcome(open_pieces(path, &options).and_then(|pieces| {
                let n_voxels = pieces.grid().n_voxels();
                let mut n_seen = 0;
                pieces.for_each(|_, values| n_seen += values.len())?;
                assert_eq!(n_seen, n_voxels, "as many values as voxels");
                Ok(())
            })),
            _ => {
                let corners = [DVec3::new(-3.0, -4.0, 1.0), DVec3::new(2.0, 3.0, 9.0)];
                outcome(files(path, &options).and_then(|_| read_box(path, &options, (corners, 1))))
            }
        }
    })
}

/// A folder with the files of a mutant, which goes with the value.
fn written(mutant: &Mutant) -> io::Result<tempfile::TempDir> {
    let folder = tempfile::tempdir()?;
    for (name, bytes) in &mutant.files {
        fs::write(folder.path().join(name), bytes)?;
    }
    Ok(folder)
}

fn polylines(bytes: &[u8]) -> Outcome {
    let scale = SwcScale::millimetres();
    outcome(polydata::parse(bytes, &scale, Some(DVec3::ONE), MAX_BYTES).map(|(polylines, _)| {
        let n_points = polylines.points_mm.len();
        assert_eq!(polylines.radii_mm.len(), n_points, "a radius for each point");
        assert!(polylines.lines.iter().flat_map(|line| &line.points).all(|&point| point < n_points));
        let _ = espalier_tree::join_lines(&polylines);
    }))
}

/// The code of an error, whose message is looked at.
fn outcome<T>(result: Result<T, impl Diagnose>) -> Outcome {
    let Err(error) = result else { return Ok(()) };
    for text in [error.to_string(), error.hint()] {
        assert!(text.len() <= MAX_MESSAGE_BYTES, "a message of {} bytes: {text:.200}", text.len());
    }
    Err(error.code().to_owned())
}
