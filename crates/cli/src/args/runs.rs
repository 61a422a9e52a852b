//! One run, one of its stages, or a phantom to run.

use std::path::PathBuf;

use clap::Args;
use espalier_pipeline::Stage;

use super::words::parse_stage;

/// `espalier run`.
#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    /// A config (.toml), or an input: a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd, a folder of
    /// DICOM slices) or a traced tree (.swc, .vtp, .vtk)
    pub(crate) config_or_input: PathBuf,
    /// The run folder [default: out/NAME]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Begin at this stage, with what the earlier ones left in the run folder
    #[arg(long, value_name = "STAGE", value_parser = parse_stage)]
    pub(crate) from: Option<Stage>,
    /// End after this stage
    #[arg(long, value_name = "STAGE", value_parser = parse_stage)]
    pub(crate) to: Option<Stage>,
    /// Do nothing; say which stages would be done, and why
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

/// How a command deals with a run folder that is in use.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Rerun {
    /// Do stages again also where their results stand: made from the same files and settings, and not altered since; and
    /// write over files that no run has made
    #[arg(long)]
    pub(crate) force: bool,
    /// Wait for another run that holds the folder, rather than to stop with exit code 75
    #[arg(long)]
    pub(crate) wait: bool,
}

/// A stage on its own.
#[derive(Debug, Args)]
pub(crate) struct StageArguments {
    /// A run folder, or the stage's input files in the order of its description
    #[arg(required = true, value_name = "RUN|FILE")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Where to write [default: the run folder itself]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Take the settings from this config
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

/// `espalier phantom`.
#[derive(Debug, Args)]
pub(crate) struct PhantomArguments {
    /// airway, vessel, neuron, straight, bent, helix, y, torus or comb
    pub(crate) kind: String,
    /// The folder for its files
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The seed
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
}
