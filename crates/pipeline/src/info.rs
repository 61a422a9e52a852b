//! What this program is: all that can make two results differ, and what it reads and writes.

use serde::Serialize;

use crate::config;
use crate::stage::Stage;

/// What this program is.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// The version of espalier.
    pub version: &'static str,
    /// The machine that it was built for.
    pub target: Target,
    /// The stages in order, each with the version of what it makes: results of other versions are made again.
    pub stages: Vec<Versioned>,
    /// The version of the config's schema.
    pub config_schema: u32,
    /// What volumes and traced trees can be read from.
    pub reads: Vec<Reader>,
    /// The most that is taken, whatever memory there is.
    pub limits: Vec<Limit>,
}

/// The machine that the program was built for. No result depends on it.
#[derive(Clone, Debug, Serialize)]
pub struct Target {
    /// Such as `x86_64`.
    pub arch: &'static str,
    /// Such as `linux`.
    pub os: &'static str,
    /// Instructions beyond those of every such machine, of those that a build can turn on.
    pub features: Vec<&'static str>,
    /// Whether it was built with checks and without all optimisation.
    pub is_debug: bool,
}

/// A name and its version.
#[derive(Clone, Debug, Serialize)]
pub struct Versioned {
    /// The name.
    pub name: &'static str,
    /// The version.
    pub version: u32,
}

/// A format that is read.
#[derive(Clone, Debug, Serialize)]
pub struct Reader {
    /// Its name.
    pub format: &'static str,
    /// How its files mostly end; what counts is their content.
    pub files: &'static str,
    /// What of it is read.
    pub reads: &'static str,
}

/// A fixed limit.
#[derive(Clone, Debug, Serialize)]
pub struct Limit {
    /// Of what.
    pub name: &'static str,
    /// How much.
    pub value: u64,
}

/// Formats of volumes and trees, as `espalier_volume` and `espalier_model` read them.
const READERS: [Reader; 6] = [
    Reader {
        format: "NIfTI",
        files: ".nii, .nii.gz, .hdr with .img",
        reads: "versions 1 and 2, one volume or one of several (--volume-index)",
    },
    Reader { format: "NRRD", files: ".nrrd, .nhdr", reads: "raw, gzip, bzip2, ascii" },
    Reader { format: "MetaImage", files: ".mha, .mhd", reads: "raw, zlib, ascii" },
    Reader {
        format: "DICOM",
        files: "a folder of slices, or one of them",
        reads: "uncompressed, deflated, RLE, JPEG lossless and 8-bit, JPEG-LS, JPEG 2000",
    },
    Reader {
        format: "SWC",
        files: ".swc",
        reads: "seven columns or more, in µm unless input.unit says otherwise",
    },
    Reader { format: "VTK", files: ".vtp, .vtk", reads: "polylines, as text or binary, plain or zlib" },
];

/// What this program is.
#[must_use]
pub fn info() -> Info {
    Info {
        version: env!("CARGO_PKG_VERSION"),
        target: Target {
            arch: std::env::consts::ARCH,
            os: std::env::consts::OS,
            features: features(),
            is_debug: cfg!(debug_assertions),
        },
        stages: Stage::ALL.map(|stage| Versioned { name: stage.name(), version: stage.version() }).into(),
        config_schema: config::SCHEMA,
        reads: READERS.into(),
        limits: vec![
            Limit { name: "phantom_nodes", value: espalier_phantom::MAX_NODES as u64 },
            Limit { name: "phantom_voxels", value: espalier_phantom::MAX_VOXELS as u64 },
            Limit { name: "group_runs", value: crate::group::MOST_RUNS as u64 },
            Limit { name: "sweep_combinations", value: crate::sweep::MOST_COMBINATIONS },
        ],
    }
}

/// Of the instructions that make programs faster those that this build relies on.
fn features() -> Vec<&'static str> {
    let known = [
        ("avx", cfg!(target_feature = "avx")),
        ("avx2", cfg!(target_feature = "avx2")),
        ("avx512f", cfg!(target_feature = "avx512f")),
        ("fma", cfg!(target_feature = "fma")),
        ("neon", cfg!(target_feature = "neon")),
        ("popcnt", cfg!(target_feature = "popcnt")),
        ("sse4.2", cfg!(target_feature = "sse4.2")),
    ];
    known.into_iter().filter(|(_, is_on)| *is_on).map(|(name, _)| name).collect()
}
