// What the scripts of pages share, for `tsc --checkJs` (make lint).
declare const uPlot: any;
declare let mapmore: any;
interface Window {
    mapmore: any;
}
