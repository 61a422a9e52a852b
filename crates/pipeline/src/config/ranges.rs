//! The range of each number of a config, asked of `validate()` itself.
//!
//! **Input** a dotted key. **Output** the [`Range`] of values about its default that `validate()` takes.
//! **Steps** 1. The largest finite numbers either way: where they are legal there is no bound. 2. Bisection over all
//! floating-point numbers, or over whole numbers, between the default and them, until two neighbours are left, one legal
//! and one not. 3. The bound is the one of the two that is shorter to write: 0, and not the least number above it.
//! **Guarantees** nothing is written down twice: a range that changes in `validate()` changes here. A key whose legal
//! values are no interval, or that is only legal together with others, has none; its text says what is legal.
//! **Cost** at most 130 validations of one table for each key.

use serde_json::Value;

use super::{Config, Input, place};

/// A range, open where it has no bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    /// The least value.
    pub least: Option<Bound>,
    /// The largest value.
    pub most: Option<Bound>,
}

/// One end of a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    /// Where it is.
    pub at: f64,
    /// Whether it is legal itself.
    pub is_legal: bool,
}

/// Whole numbers beyond are not held exactly; none of ours goes so far.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Values to begin with where a key has no default.
const BEGINNINGS: [f64; 5] = [1.0, 0.5, 0.0, 10.0, 100.0];

/// Values between the bounds that must be legal, as shares of the way.
const BETWEEN: [f64; 5] = [0.01, 0.25, 0.5, 0.75, 0.99];

/// A config in which every table is legal.
pub(super) fn defaults() -> Value {
    let input = Input { phantom: Some(espalier_phantom::Kind::Neuron), ..Input::default() };
    // Plain structs: serialisation cannot fail.
    serde_json::to_value(Config { input, ..Config::default() }).unwrap_or_default()
}

/// The range of the number at a dotted key, or of each number of a list.
pub(super) fn find(defaults: &Value, key: &str, is_integer: bool) -> Option<Range> {
    let probe = Probe::new(defaults, key, is_integer)?;
    let begin = probe.begin()?;
    let largest = if is_integer { LARGEST_WHOLE } else { f64::MAX };
    let range = Range { least: probe.bound(begin, -largest), most: probe.bound(begin, largest) };
    probe.holds(range, begin).then_some(range).filter(|range| range.least.is_some() || range.most.is_some())
}

/// A key whose value is tried out.
struct Probe<'a> {
    defaults: &'a Value,
    names: Vec<&'a str>,
    is_integer: bool,
    /// How many numbers the key has, where it has a list.
    n_numbers: Option<usize>,
    default: Option<f64>,
}

impl<'a> Probe<'a> {
    fn new(defaults: &'a Value, key: &'a str, is_integer: bool) -> Option<Self> {
        let names: Vec<&str> = key.split('.').collect();
        let value = names.iter().try_fold(defaults, |value, name| value.get(name));
        let numbers = |list: &Vec<Value>| list.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        let (default, n_numbers) = match value {
            Some(Value::Array(list)) => {
                let numbers = numbers(list)?;
                // Numbers that differ have meanings of their own.
                let first = *numbers.first()?;
                numbers.iter().all(|number| *number == first).then_some((Some(first), Some(numbers.len())))?
            }
            Some(value) => (value.as_f64(), None),
            None => (None, None),
        };
        Some(Self { defaults, names, is_integer, n_numbers, default })
    }

    fn begin(&self) -> Option<f64> {
        self.default.into_iter().chain(BEGINNINGS).find(|value| self.is_legal(*value))
    }

    /// The bound between a legal value and one far off, if there is one.
    fn bound(&self, legal: f64, far: f64) -> Option<Bound> {
        if self.is_legal(far) {
            return None;
        }
        let (mut inside, mut outside) = (self.place(legal), self.place(far));
        while inside.abs_diff(outside) > 1 {
            let middle = inside.midpoint(outside);
            if self.is_legal(self.value(middle)) { inside = middle } else { outside = middle }
        }
        let (inside, outside) = (self.value(inside), self.value(outside));
        let is_shorter = !self.is_integer && outside.to_string().len() < inside.to_string().len();
        Some(if is_shorter {
            Bound { at: outside, is_legal: false }
        } else {
            Bound { at: inside, is_legal: true }
        })
    }

    /// Whether values inside of the range are legal.
    fn holds(&self, range: Range, begin: f64) -> bool {
        let ends = [range.least, range.most].map(|bound| bound.map_or(begin, |bound| bound.at));
        BETWEEN.iter().all(|share| {
            let value = ends[0] + share * (ends[1] - ends[0]);
            self.is_legal(if self.is_integer { value.round() } else { value })
        })
    }

    /// Where a number stands among all numbers of its kind.
    fn place(&self, value: f64) -> i64 {
        if self.is_integer {
            return value as i64;
        }
        let bits = value.to_bits() as i64;
        if bits < 0 { i64::MIN.wrapping_sub(bits) } else { bits }
    }

    fn value(&self, place: i64) -> f64 {
        if self.is_integer {
            return place as f64;
        }
        f64::from_bits(if place < 0 { i64::MIN.wrapping_sub(place) } else { place } as u64)
    }

    fn is_legal(&self, value: f64) -> bool {
        let number = if self.is_integer { Value::from(value as i64) } else { Value::from(value) };
        let value = match self.n_numbers {
            Some(n_numbers) => Value::from(vec![number; n_numbers]),
            None => number,
        };
        // The seed and its like stand outside of all tables.
        let [table, inner @ ..] = self.names.as_slice() else { return false };
        if inner.is_empty() {
            return is_legal_config(with(self.defaults.clone(), &self.names, value));
        }
        let section = self.defaults.get(table).cloned().unwrap_or_default();
        is_legal_table(table, with(section, inner, value))
    }
}

/// A value with another one at a place inside.
fn with(mut whole: Value, names: &[&str], value: Value) -> Value {
    let mut slot = &mut whole;
    for name in names {
        let Value::Object(table) = slot else { return whole };
        slot = table.entry(*name).or_insert(Value::Null);
    }
    *slot = value;
    whole
}

fn is_legal_config(whole: Value) -> bool {
    let source = place::SourceText { text: "", path: std::path::Path::new(""), overrides: &[] };
    serde_json::from_value::<Config>(whole).is_ok_and(|config| config.validate(&source).is_ok())
}

/// Whether a stage takes its table.
fn is_legal_table(table: &str, value: Value) -> bool {
    macro_rules! legal {
        ($params:ty) => {
            serde_json::from_value::<$params>(value).is_ok_and(|params| params.validate().is_ok())
        };
    }
    match table {
        "input" => legal!(Input),
        "phantom" => legal!(espalier_phantom::Params),
        "volume" => legal!(espalier_volume::Params),
        "skeleton" => legal!(espalier_skeleton::Params),
        "radius" => legal!(espalier_radius::Params),
        "tree" => legal!(espalier_tree::Params),
        "views" => legal!(espalier_views::Params),
        "embed" => legal!(espalier_embed::Params),
        "render" => legal!(espalier_render::Params),
        "report" => legal!(espalier_report::Params),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(key: &str, is_integer: bool) -> Option<(Option<f64>, Option<f64>)> {
        let range = find(&defaults(), key, is_integer)?;
        Some((range.least.map(|bound| bound.at), range.most.map(|bound| bound.at)))
    }

    #[test]
    fn ranges_are_those_of_validate() {
        assert_eq!(range("tree.prune_factor", false), Some((Some(0.0), Some(10.0))));
        assert_eq!(range("tree.tolerance", false), Some((Some(1e-6), Some(1.0))));
        assert_eq!(range("render.width_px", true), Some((Some(240.0), Some(16384.0))));
        assert_eq!(range("input.scale", false), Some((Some(1e-9), Some(1e9))));
        assert_eq!(range("input.series", true), Some((Some(1.0), None)));
        assert_eq!(range("volume.closing_mm", false), Some((Some(0.0), Some(1000.0))));
    }

    /// Legal only together with `method`: the text says so.
    #[test]
    fn what_hangs_on_other_keys_has_no_range() {
        assert_eq!(range("volume.lower", false), None);
    }

    #[test]
    fn places_are_in_the_order_of_numbers() {
        let defaults = defaults();
        let probe = Probe::new(&defaults, "tree.tolerance", false).expect("a key");
        let numbers = [-f64::MAX, -1.0, -1e-300, -0.0, 1e-300, 1.0, f64::MAX];
        for pair in numbers.windows(2) {
            assert!(probe.place(pair[0]) < probe.place(pair[1]), "{pair:?}");
            assert_eq!(probe.value(probe.place(pair[1])), pair[1]);
        }
    }
}
