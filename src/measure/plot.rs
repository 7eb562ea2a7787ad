//! Plots of points over logarithmic axes, as SVG.

use super::MeasureError;
use plotters::prelude::{
    ChartBuilder, Circle, Color, IntoDrawingArea, IntoLogRange, LineSeries, Palette, Palette99, PathElement, RGBColor,
    SVGBackend, Text, WHITE,
};

/// Points joined in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Those with a coordinate that is not positive and finite are left out.
    pub points: Vec<[f64; 2]>,
}

/// Width of the legend in pixels.
const LEGEND: u32 = 150;

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Above the plot.
    pub title: String,
    /// Names of the axes, with units.
    pub axes: [String; 2],
    /// The curves.
    pub series: Vec<Series>,
    /// Size in pixels.
    pub size: [u32; 2],
}

impl Plot {
    /// The plot as an SVG document.
    ///
    /// # Errors
    /// [`MeasureError::Plot`] if there is nothing to draw.
    pub fn svg(&self) -> Result<String, MeasureError> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|why| MeasureError::Plot(self.title.clone(), why))?;
        Ok(text)
    }

    fn draw(&self, text: &mut String) -> Result<(), String> {
        let usable = |p: &&[f64; 2]| p.iter().all(|x| x.is_finite() && *x > 0.0);
        let points = || self.series.iter().flat_map(|s| s.points.iter()).filter(usable);
        let range = |axis: usize| {
            let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            let high = points().map(|p| p[axis]).fold(0.0, f64::max);
            // Whole decades, so that the grid says where one is.
            10_f64.powf(low.log10().floor())..10_f64.powf((high.log10() + 1e-9).ceil()).max(low * 10.0)
        };
        if points().next().is_none() {
            return Err(String::from("there are no points to draw"));
        }
        let say = |error: &dyn std::fmt::Display| error.to_string();
        let area = SVGBackend::with_string(text, (self.size[0], self.size[1])).into_drawing_area();
        area.fill(&WHITE).map_err(|e| say(&e))?;
        let (left, legend) = area.split_horizontally(self.size[0].saturating_sub(LEGEND));
        let color = |index: usize| Palette99::pick(index % Palette99::COLORS.len()).to_rgba();
        let mut chart = ChartBuilder::on(&left)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(70)
            .build_cartesian_2d(range(0).log_scale(), range(1).log_scale())
            .map_err(|e| say(&e))?;
        chart
            .configure_mesh()
            .x_desc(&self.axes[0])
            .y_desc(&self.axes[1])
            .x_label_formatter(&|x| power(*x))
            .y_label_formatter(&|y| power(*y))
            .bold_line_style(RGBColor(205, 205, 205))
            .light_line_style(WHITE)
            .label_style(("sans-serif", 13))
            .draw()
            .map_err(|e| say(&e))?;
        for (index, series) in self.series.iter().enumerate() {
            let color = color(index);
            let line: Vec<(f64, f64)> = series.points.iter().filter(usable).map(|p| (p[0], p[1])).collect();
            chart.draw_series(LineSeries::new(line.iter().copied(), color.stroke_width(2))).map_err(|e| say(&e))?;
            chart.draw_series(line.iter().map(|p| Circle::new(*p, 3, color.filled()))).map_err(|e| say(&e))?;
        }
        // The legend stands beside the plot, where it hides nothing.
        for (index, series) in self.series.iter().enumerate() {
            let y = 48 + 20 * index as i32;
            let line = PathElement::new([(4, y), (22, y)], color(index).stroke_width(2));
            legend.draw(&line).map_err(|e| say(&e))?;
            let name = Text::new(series.name.clone(), (28, y - 7), ("sans-serif", 13));
            legend.draw(&name).map_err(|e| say(&e))?;
        }
        area.present().map_err(|e| say(&e))
    }
}

/// A power of ten as such.
fn power(x: f64) -> String {
    let exponent = x.log10();
    if (-2.0..4.0).contains(&exponent) { format!("{}", (x * 1e4).round() / 1e4) } else { format!("1e{exponent:.0}") }
}
