//! A profile beside an earlier one, configuration by configuration.

use super::{
    profile::KEY,
    report::{Cell, SCHEMA, Table},
};
use serde_json::Value;

/// The profile of an earlier run.
#[derive(Clone, Debug)]
pub struct Earlier {
    rows: Vec<Value>,
    /// What it was measured on and with.
    pub settings: Value,
}

/// Values of which both and their ratio are shown, with the stems of the columns' names.
const TIMES: [(&str, &str); 4] = [
    ("frame_ms_median", "frame_ms"),
    ("cpu_ms_median", "cpu_ms"),
    ("ns_per_segment", "ns_per_segment"),
    ("memory_bytes", "memory_bytes"),
];

/// Counts of which the ratio is shown.
const COUNTS: [&str; 4] = ["segments_per_pixel", "bounces_per_pixel", "nodes_per_pixel", "tests_per_pixel"];

impl Earlier {
    /// Reads the text of a `profile.json`.
    ///
    /// # Errors
    /// What is wrong with it, on one line: no JSON, another schema, another command's report.
    pub fn read(text: &str) -> Result<Self, String> {
        let report: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if report["schema"] != SCHEMA {
            return Err(match report.get("schema") {
                Some(schema) => format!("schema {schema} cannot be compared with schema {SCHEMA}"),
                None => String::from("not a profile: there is no schema number"),
            });
        }
        if report["command"] != "profile" {
            return Err(format!("a report of the command {}, not of profile", report["command"]));
        }
        let rows = report["frames"]["rows"].as_array().ok_or("not a profile: there are no frames")?;
        Ok(Self { rows: rows.clone(), settings: report["settings"].clone() })
    }

    fn row(&self, key: &[Cell]) -> Option<&Value> {
        self.rows.iter().find(|row| KEY.iter().zip(key).all(|(name, cell)| same(&row[*name], cell)))
    }

    /// Whether it has a configuration.
    pub fn has(&self, key: &[Cell]) -> bool {
        self.row(key).is_some()
    }

    /// Old and new values with the ratio new to old, for each of the new profile's rows that the old one has.
    pub fn compare(&self, new: &Table) -> Table {
        let mut columns: Vec<String> = KEY.iter().map(|name| (*name).to_owned()).collect();
        for (_, stem) in TIMES {
            columns.extend([format!("{stem}_before"), format!("{stem}_now"), format!("{stem}_ratio")]);
        }
        columns.extend(COUNTS.iter().map(|name| format!("{name}_ratio")));
        let about = String::from("an earlier profile and this one; ratios are now to before, below 1 is less");
        let mut table = Table { name: String::from("comparison"), about, columns, rows: Vec::new() };
        for row in &new.rows {
            let Some(old) = row.get(..KEY.len()).and_then(|key| self.row(key)) else { continue };
            let pair = |name: &str| (old[name].as_f64(), new.number(row, name));
            let mut cells = row[..KEY.len()].to_vec();
            for (name, _) in TIMES {
                let (before, now) = pair(name);
                cells.extend([before.into(), now.into(), ratio((before, now)).into()]);
            }
            cells.extend(COUNTS.iter().map(|name| Cell::from(ratio(pair(name)))));
            table.push(cells);
        }
        table
    }
}

fn same(value: &Value, cell: &Cell) -> bool {
    match (cell, value.as_f64()) {
        // Text of files keeps all digits, but other programs may have written them.
        (Cell::Number(x), Some(y)) => (x - y).abs() <= 1e-12 * x.abs(),
        _ => cell.json() == *value,
    }
}

/// Now to before; nothing to nothing is no change.
fn ratio((before, now): (Option<f64>, Option<f64>)) -> Option<f64> {
    match (before?, now?) {
        (0.0, 0.0) => Some(1.0),
        (before, now) => Some(now / before),
    }
}
