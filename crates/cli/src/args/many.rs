//! Several runs: side by side, against each other, at many settings, as a group or a cohort.

use std::path::PathBuf;

use clap::Args;
use espalier_pipeline::Axis;

use super::runs::Rerun;
use super::words::{parse_axis, parse_filter};

const COMPARE_HELP: &str = "\
Writes into the folder: compare.tsv and compare.json (a row per run and method), compare.png and compare.svg (each tree
in space, then every method's layout, main subtrees in the same colours), dictionary.tsv (what each column means).
Which methods a run has is set by embed.methods; they share one set of targets and one energy.

Examples:
  espalier compare out/airway                            the methods of a run
  espalier compare out/a out/b out/c -o out/abc          runs: rows that compare share tree and targets
  espalier compare neuron.swc --set embed.pso.freedom=s  runs it up to the embedding first
  espalier compare out/airway --set render.theme=dark    of finished runs, the pictures can be set";

/// `espalier compare`.
#[derive(Debug, Args)]
#[command(after_help = COMPARE_HELP)]
pub(crate) struct CompareArguments {
    /// Run folders; or configs (.toml) and inputs, which are run first, each to a folder of its name in DIR
    #[arg(required = true, value_name = "RUN|CONFIG")]
    pub(crate) subjects: Vec<PathBuf>,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/compare")]
    pub(crate) out: PathBuf,
}

const JUXTAPOSE_HELP: &str = "\
The follow-up is moved onto the baseline by the forks that match (no images are registered), branches are matched from
the root on, and the tree of both is laid flat once, with the baseline's settings: what both have lies in the same place
of both panels, at the baseline's lengths.

Writes into the folder: juxtaposition.png and juxtaposition.svg (both trees at one scale, differences coloured),
juxtaposition.tsv (a row per branch: matched, lost or new; lengths, radii, their change, the narrowest place, angles),
juxtaposition.json (how the follow-up was moved, what that leaves in mm), shared.swc, shared-nodes.tsv and
shared-embedding.json (the tree of both), dictionary.tsv (what each column means).

Examples:
  espalier juxtapose out/2023 out/2024 -o out/change         two runs
  espalier juxtapose before.nii.gz after.nii.gz              runs both up to the tree first
  espalier juxtapose out/a out/b --align similarity          an animal that grew
  espalier juxtapose out/a out/b --change length             colours by change of length";

/// `espalier juxtapose`.
#[derive(Debug, Args)]
#[command(after_help = JUXTAPOSE_HELP)]
pub(crate) struct JuxtaposeArguments {
    /// The baseline: a run folder; or a config (.toml) or an input, which is run first, to a folder of its name in DIR
    #[arg(value_name = "BASELINE")]
    pub(crate) baseline: PathBuf,
    /// The follow-up, likewise
    #[arg(value_name = "FOLLOWUP")]
    pub(crate) followup: PathBuf,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/juxtapose")]
    pub(crate) out: PathBuf,
    /// How the follow-up is brought to the baseline: turned and moved; scaled too; or as it is, in the same space
    #[arg(long, value_name = "HOW", default_value = "rigid", value_parser = ["rigid", "similarity", "as-is"])]
    pub(crate) align: String,
    /// What the colours mean
    #[arg(long, value_name = "WHAT", default_value = "radius", value_parser = ["radius", "length"])]
    pub(crate) change: String,
}

const SWEEP_HELP: &str = "\
Embeds the config at every combination of the values; stages that no key changes run once. Writes into the folder:
sweep.tsv (a row per combination: its values, the row of its embedding as in compare.tsv, or the reason why there is
none), sweep.png and sweep.svg (losses against the first key, one line for each combination of the others), base/ and
runs/NNN/ (the stages' own files). Energies at different weights do not compare; losses do.

Examples:
  espalier sweep neuron.swc --over embed.w_length=0.5,1,2,4
  espalier sweep my.toml --over embed.w_length=0.5,1,2,4 --over embed.w_angle=1,2,4 -o out/weights
  espalier sweep my.toml --over embed.method=radial,marino,solver     words need no quotes
  espalier sweep my.toml --over 'volume.seed_voxel=[1,2,3],[4,5,6]'   commas inside brackets do not part values";

/// `espalier sweep`.
#[derive(Debug, Args)]
#[command(after_help = SWEEP_HELP)]
pub(crate) struct SweepArguments {
    /// A config (.toml), or an input: a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd, a folder of
    /// DICOM slices) or a traced tree (.swc, .vtp, .vtk)
    pub(crate) config_or_input: PathBuf,
    /// A key and its values; may be given many times, for all combinations
    #[arg(long = "over", value_name = "KEY=V1,V2,…", required = true, value_parser = parse_axis)]
    pub(crate) axes: Vec<Axis>,
    /// Where the results go [default: out/NAME-sweep]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

const GROUP_HELP: &str = "\
Writes into the folder: group.html (one file: the maps in small, a table that sorts and filters, distributions, outliers,
runs without a map with the reason and the commands that try again, equal inputs, settings that differ), group.tsv and
group.json (a row per run), dictionary.tsv (what each column means).

Runs are labelled with their folders as you type them, without what all have in common; nothing else of a run's name or
input is on the page. If folders are named after patients, say --anonymous. A run that cannot be read, or has not come to a
map, is a row with its reason; exit code 74 if no folder holds a run.

Examples:
  espalier group out -o group                           all run folders in out
  espalier group out/case-* -o group --title \"Cohort A\"
  espalier group out --anonymous -o share               labels run-1, run-2, …";

/// `espalier group`.
#[derive(Debug, Args)]
#[command(after_help = GROUP_HELP)]
pub(crate) struct GroupArguments {
    /// Run folders, or folders that have run folders in them
    #[arg(required = true, value_name = "RUN|FOLDER")]
    pub(crate) folders: Vec<PathBuf>,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/group")]
    pub(crate) out: PathBuf,
    /// The heading of the page
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// Number the runs in place of their folders' names
    #[arg(long)]
    pub(crate) anonymous: bool,
}

const COHORT_HELP: &str = "\
The table has tabs between its cells, a heading, and a row a scan. Columns:
  id            what the scan is called: its run folder is DIR/runs/ID
  path          the scan, mask, label map or traced tree, relative to the table; $ESPALIER_DATA is expanded
  config        a config (.toml) to run it with, relative to the table
  preset, label, labels, image, series, volume_index, seed      as the options of these names
  embed.w_angle, tree.root, ...                                 any key of the config
  note, note.age, ...                                           yours; not read
Only id is needed, and path or config. An empty cell, or n/a, says nothing; lines that begin with # are passed over.
Options of the command line have the last word over all rows.

Does one scan after the other, and then DIR/group/group.html. A scan that fails stops no other: DIR/failures.tsv has the
reason and the command that tries it again. The same command again does only what is missing, has failed, or has other
settings or files now. The exit code is that of the first scan that failed. Two such calls at once in one folder: one goes on,
the other ends with exit code 75, or waits with --wait; calls with --only may run beside each other.
pipelines/cohort/Snakefile does the same with many jobs at once, here or on a cluster.

Examples:
  espalier cohort samples.tsv -o out/cohort
  espalier cohort samples.tsv -o out/cohort --config airway.toml --set embed.w_angle=3
  espalier cohort samples.tsv -o out/cohort --only case-07      one scan, without the page
  espalier cohort samples.tsv -o out/cohort --group             the page alone, from what is there: with the options that
                                                                the scans were done with, or they do not count
  espalier cohort samples.tsv -o out/cohort --list              the scans as JSON, for programs that do them";

/// `espalier cohort`.
#[derive(Debug, Args)]
#[command(after_help = COHORT_HELP)]
pub(crate) struct CohortArguments {
    /// The table of the scans
    #[arg(value_name = "SAMPLES")]
    pub(crate) table: PathBuf,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/cohort")]
    pub(crate) out: PathBuf,
    /// Run the rows that name no config with this one
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Do only the scans with these ids, several with commas, and make no page
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// Make only the page and the list of failures, from what is there
    #[arg(long, conflicts_with_all = ["only", "list"])]
    pub(crate) group: bool,
    /// Do nothing; print the scans as JSON: folder, files, a digest of the settings, whether they are done
    #[arg(long)]
    pub(crate) list: bool,
    #[command(flatten)]
    pub(crate) page: PageArguments,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

const BIDS_HELP: &str = "\
participant runs every volume of the data set, sub-*/[ses-*/].../*.nii or .nii.gz, each to a run folder in OUT:
OUT/sub-01/[ses-A/]anat/sub-01_ses-A_desc-airway_mask/. group makes OUT/group/group.html over all of them, with what is
missing or has failed, and OUT/failures.tsv with the command that tries each again. OUT is a BIDS data set of derivatives,
with dataset_description.json; run folders are named in .bidsignore.

If the volumes have more than one suffix (mask, dseg, ct, ...), --suffix says which are meant. The data set must have a
dataset_description.json, and volumes be named as their folders are, unless --skip-bids-validation is given. Participants
may be done by jobs of their own, at the same time. The exit code is that of the first volume that failed.
group takes the same --suffix, --filter, --config, --set and other options as participant did: a volume that was done with
other settings does not count as done.

Examples:
  espalier bids data data/derivatives/espalier participant --suffix mask
  espalier bids data out participant --participant-label 01 02 --session-label baseline --suffix ct --preset airway
  espalier bids data out participant --suffix dseg --filter desc=totalseg --label trachea
  espalier bids data out group --suffix mask";

/// `espalier bids`.
#[derive(Debug, Args)]
#[command(after_help = BIDS_HELP)]
pub(crate) struct BidsArguments {
    /// The data set
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// Where the results go
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// The volumes one by one, or the page over them
    #[arg(value_name = "participant|group", value_parser = ["participant", "group"])]
    pub(crate) level: String,
    /// Only these participants, labels with or without sub-
    #[arg(long, alias = "participant_label", value_name = "LABEL", num_args = 1..)]
    pub(crate) participant_label: Vec<String>,
    /// Only these sessions, labels with or without ses-
    #[arg(long, alias = "session_label", value_name = "LABEL", num_args = 1..)]
    pub(crate) session_label: Vec<String>,
    /// Take the data set as it is
    #[arg(long, aliases = ["skip_bids_validation", "skip-bids-validator", "skip_bids_validator"])]
    pub(crate) skip_bids_validation: bool,
    /// What the names of the volumes end with, such as mask [default: that of all, if they have but one]
    #[arg(long, value_name = "SUFFIX")]
    pub(crate) suffix: Option<String>,
    /// Only volumes with this entity, such as desc=airway, run=1, datatype=anat; desc= for those without
    #[arg(long = "filter", value_name = "ENTITY=VALUE", value_parser = parse_filter)]
    pub(crate) filters: Vec<(String, String)>,
    /// Run them with this config
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) page: PageArguments,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

/// How a page over many scans is made.
#[derive(Debug, Args)]
pub(crate) struct PageArguments {
    /// The heading of the page
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// Number the scans on the page in place of their names
    #[arg(long)]
    pub(crate) anonymous: bool,
}
