// What the scripts of pages find there, for `tsc --checkJs` (make lint).
declare const uPlot: any;
declare const mapmore: any;
